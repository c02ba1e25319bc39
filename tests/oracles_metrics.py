"""The metrics as their equations read, in double loops: slow, and right."""

import math

import numpy as np


def literal_mse(x, y):
    total = 0.0
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            total += (float(x[i, j]) - float(y[i, j])) ** 2
    return total / x.size


def literal_ssim(x, y, data_range):
    """Equation 15 over all pixels with equal weights."""
    weight = np.full(x.shape, 1.0 / x.size)
    return _of_window(np.asarray(x, float), np.asarray(y, float), weight, data_range)


def literal_ssim_map(x, y, data_range, *, offset=0.0):
    """Equation 15 in every 11 x 11 Gaussian window that fits; ``offset`` is added to the means."""
    weight = np.array(
        [[math.exp(-((i - 5) ** 2 + (j - 5) ** 2) / (2 * 1.5**2)) for j in range(11)] for i in range(11)]
    )
    weight /= weight.sum()
    rows, cols = x.shape
    out = np.empty((rows - 10, cols - 10))
    for i in range(rows - 10):
        for j in range(cols - 10):
            here = (slice(i, i + 11), slice(j, j + 11))
            out[i, j] = _of_window(x[here], y[here], weight, data_range, offset)
    return out


def literal_mssim(x, y, data_range, *, offset=0.0):
    return literal_ssim_map(x, y, data_range, offset=offset).mean()


def _of_window(x, y, weight, data_range, offset=0.0):
    mean_x = mean_y = 0.0
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            mean_x += weight[i, j] * x[i, j]
            mean_y += weight[i, j] * y[i, j]
    variance_x = variance_y = covariance = 0.0
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            variance_x += weight[i, j] * (x[i, j] - mean_x) ** 2
            variance_y += weight[i, j] * (y[i, j] - mean_y) ** 2
            covariance += weight[i, j] * (x[i, j] - mean_x) * (y[i, j] - mean_y)
    mean_x, mean_y = mean_x + offset, mean_y + offset
    c1, c2 = (0.01 * data_range) ** 2, (0.03 * data_range) ** 2
    luminance = (2 * mean_x * mean_y + c1) / (mean_x**2 + mean_y**2 + c1)
    return luminance * (2 * covariance + c2) / (variance_x + variance_y + c2)
