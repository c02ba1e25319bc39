"""The sliding Gaussian window of Wang et al. (2004), in one pass over two pictures.

The only file of the metrics that imports numba, and itself imported at the first windowed metric.
Everything the cached kernel needs stands in this file: numba's cache on disk notices an edit of the
file of the kernel, not of another one.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Sums may be reordered and fused; NaN and infinity keep their meaning (they are refused before).
_REORDER = {"contract", "reassoc", "nsz", "arcp"}


@njit(cache=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator]
def similarity_map(x, y, weight, offset, c1, c2, with_structure):  # type: ignore[no-untyped-def]
    """Compute Wang's SSIM map, or its luminance factor alone, wherever the window fits.

    Only four filtered fields are needed: x, y, x² + y² and xy. The joint mean ``offset`` is taken
    off first, so that 16-bit pictures lose no digits in the variances. Rows of the four fields wait
    in a ring of 11; one vertical pass over the ring, then one horizontal pass over its result.
    Loops run over columns innermost, for the vectoriser.

    Parameters
    ----------
    x, y : float64 arrays (rows, cols), C order
    weight : float64 array (11,)
        The one-dimensional weights; symmetric, and eleven as the sums below are written out.
    offset : float
        Joint mean of the pictures.
    c1, c2 : float
        The stabilising constants (0.01 L)² and (0.03 L)².
    with_structure : bool
        False: only (2 μx μy + c1) / (μx² + μy² + c1).

    Returns
    -------
    float64 array (rows - 10, cols - 10)
    """
    rows, cols = x.shape
    size = weight.size
    out_cols = cols - size + 1
    w0, w1, w2, w3, w4, w5 = weight[0], weight[1], weight[2], weight[3], weight[4], weight[5]
    out = np.empty((rows - size + 1, out_cols))
    ring = np.empty((size, 4, cols))
    column = np.empty((4, cols))
    moment = np.empty((4, out_cols))
    for row in range(rows):
        slot = ring[row % size]
        for j in range(cols):
            a = x[row, j] - offset
            b = y[row, j] - offset
            slot[0, j] = a
            slot[1, j] = b
            slot[2, j] = a * a + b * b
            slot[3, j] = a * b
        top = row - size + 1
        if top < 0:
            continue
        s0, s1, s2 = top % size, (top + 1) % size, (top + 2) % size
        s3, s4, s5 = (top + 3) % size, (top + 4) % size, (top + 5) % size
        s6, s7, s8 = (top + 6) % size, (top + 7) % size, (top + 8) % size
        s9, s10 = (top + 9) % size, row % size
        for field in range(4):
            # All eleven taps in one expression keep the sums in registers: 2.5 times faster than
            # a loop over the taps.
            for j in range(cols):
                column[field, j] = (
                    w0 * (ring[s0, field, j] + ring[s10, field, j])
                    + w1 * (ring[s1, field, j] + ring[s9, field, j])
                    + w2 * (ring[s2, field, j] + ring[s8, field, j])
                    + w3 * (ring[s3, field, j] + ring[s7, field, j])
                    + w4 * (ring[s4, field, j] + ring[s6, field, j])
                    + w5 * ring[s5, field, j]
                )
            line = column[field]
            for j in range(out_cols):
                moment[field, j] = (
                    w0 * (line[j] + line[j + 10])
                    + w1 * (line[j + 1] + line[j + 9])
                    + w2 * (line[j + 2] + line[j + 8])
                    + w3 * (line[j + 3] + line[j + 7])
                    + w4 * (line[j + 4] + line[j + 6])
                    + w5 * line[j + 5]
                )
        for j in range(out_cols):
            a = moment[0, j]
            b = moment[1, j]
            mean_x = a + offset
            mean_y = b + offset
            upper = 2 * mean_x * mean_y + c1
            lower = mean_x * mean_x + mean_y * mean_y + c1
            if with_structure:
                upper *= 2 * (moment[3, j] - a * b) + c2
                lower *= moment[2, j] - a * a - b * b + c2
            out[top, j] = upper / lower
    return out
