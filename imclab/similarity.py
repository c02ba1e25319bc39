"""Metrics of one condition with their uncertainties, frame by frame.

A metric's uncertainty is that of its mean over repeated frames; with a single frame it is the spread
over frames drawn from the calibrated noise. Pixels or blocks of one picture are not repeats of it, so
no bootstrap over them is offered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from imclab import metrics
from imclab.uncertainty import Estimate

FloatArray = NDArray[np.float64]
Metric = Callable[..., float]

METRICS: dict[str, Metric] = {
    "ssim": metrics.ssim,
    "mssim": metrics.mssim,
    "psnr": metrics.psnr,
    "luminance_mssim": metrics.luminance_mssim,
}
UNITS = {"ssim": "1", "mssim": "1", "psnr": "dB", "luminance_mssim": "1"}
NOISE_DRAWS = 16


def score(
    pairs: Iterable[tuple[FloatArray, FloatArray]], *, region: NDArray[np.bool_], data_range: float
) -> dict[str, FloatArray]:
    """Return every metric of each pair of pictures over ``region``."""
    values = [
        [metric(x, y, data_range=data_range, mask=region) for metric in METRICS.values()] for x, y in pairs
    ]
    return dict(zip(METRICS, np.array(values, dtype=np.float64).T, strict=True))


def mean_of(scores: dict[str, FloatArray]) -> dict[str, Estimate]:
    """Return the mean of each metric with its standard error; at least two values are needed."""
    return {
        name: Estimate(
            float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values))), len(values) - 1
        )
        for name, values in scores.items()
    }


def single(scores: dict[str, FloatArray], draws: dict[str, FloatArray]) -> dict[str, Estimate]:
    """Return the metrics of one pair, each with the spread that ``draws`` of it show."""
    return {
        name: Estimate(float(values[0]), float(draws[name].std(ddof=1))) for name, values in scores.items()
    }
