"""How sharp a picture is: profiles across the target, contrast, and the response to a slanted edge.

The edge response follows ISO 12233 (e-SFR): an edge that crosses the pixel rows at a small angle is
sampled at many distances, which gives the edge spread function (ESF) finer than the pixels; its
derivative is the line spread function (LSF), and the modulus of that one's Fourier transform the
modulation transfer function (MTF).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, uniform_filter
from scipy.signal.windows import tukey

from imclab.uncertainty import Estimate

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

EDGE_LENGTH, EDGE_BREADTH = 33, 17
"""Pixels along and across the edge that `find_edge` looks for."""

_OVERSAMPLING = (4, 2, 1)
_RESAMPLES = 40
_LEAST_REACH = 4.5  # pixels on both sides of an edge; fewer cut its line spread off


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Mean over a band of rows (or columns), along the other direction.

    Attributes
    ----------
    position : array (n)
        Pixel column (or row).
    mean, stderr : array (n)
        In the picture's unit; NaN where no pixel counts. The standard error takes the pixels of the
        band for independent.
    """

    position: FloatArray
    mean: FloatArray
    stderr: FloatArray


@dataclass(frozen=True, kw_only=True)
class EdgeResponse:
    """Response to one slanted edge.

    Attributes
    ----------
    angle : float
        Between the edge and the nearer pixel axis, rad.
    distance : array (n)
        Across the edge, px; zero on the edge.
    spread : array (n)
        Edge spread function, from 0 (dark side) to 1 (bright side) for a clean edge.
    frequency : array (m)
        Cycles per pixel, up to 1.
    mtf, mtf_stderr : array (m)
        Modulation transfer; one at frequency zero by definition. The standard error is NaN when the
        pixels came without one.
    mtf50 : Estimate
        Frequency at which the modulation has fallen to one half, cycles per pixel.
    """

    angle: float
    distance: FloatArray
    spread: FloatArray
    frequency: FloatArray
    mtf: FloatArray
    mtf_stderr: FloatArray
    mtf50: Estimate


def profile(picture: FloatArray, stderr: FloatArray, region: BoolArray, *, axis: int, band: slice) -> Profile:
    """Average ``picture`` over ``band`` of ``axis`` where ``region`` holds.

    Parameters
    ----------
    picture, stderr : array (rows, columns)
    region : bool array (rows, columns)
    axis : int
        0 averages rows and gives a profile along the columns; 1 the other way.
    band : slice
        Rows (or columns) to average.
    """
    if axis == 1:
        picture, stderr, region = picture.T, stderr.T, region.T
    inside = region[band] & np.isfinite(picture[band])
    count = np.where(inside.any(axis=0), inside.sum(axis=0), np.nan)
    mean = np.where(inside, picture[band], 0.0).sum(axis=0) / count
    spread = np.sqrt(np.where(inside, stderr[band] ** 2, 0.0).sum(axis=0)) / count
    return Profile(position=np.arange(mean.size, dtype=np.float64), mean=mean, stderr=spread)


def contrast(picture: FloatArray, stderr: FloatArray, *, bright: BoolArray, dark: BoolArray) -> Estimate:
    """Michelson contrast (B - D)/(B + D) of the mean levels of two sets of pixels."""
    high, low = picture[bright].mean(), picture[dark].mean()
    u_high = math.sqrt((stderr[bright] ** 2).sum()) / bright.sum()
    u_low = math.sqrt((stderr[dark] ** 2).sum()) / dark.sum()
    total = high + low
    return Estimate(float((high - low) / total), float(2 * math.hypot(low * u_high, high * u_low) / total**2))


def find_edge(picture: FloatArray, region: BoolArray) -> tuple[slice, slice] | None:
    """Find the window with the strongest single straight edge, in a picture of little noise.

    The measure is the length of the mean gradient over the mean length of the gradients: one for a
    straight edge, near zero for the two sides of a bar. The edge runs through the whole window, along
    its middle.

    Parameters
    ----------
    picture : array (rows, columns)
    region : bool array
        The window lies wholly inside.

    Returns
    -------
    tuple of slice, or None
        Rows and columns; None when no window fits or nothing in it is straight.
    """
    smooth = gaussian_filter(np.where(region, np.nan_to_num(picture), 0.0), 1.0)
    down, right = np.gradient(smooth)
    length = np.hypot(down, right)
    if not length.any():
        return None
    best: tuple[float, tuple[slice, slice] | None] = (0.0, None)
    for size in ((EDGE_LENGTH, EDGE_BREADTH), (EDGE_BREADTH, EDGE_LENGTH)):
        if min(region.shape[0] - size[0], region.shape[1] - size[1]) < 0:
            continue
        fits = uniform_filter(region.astype(float), size, mode="constant") > 1 - 1e-9
        total = np.maximum(uniform_filter(length, size), 1e-6 * length.max())
        straight = np.hypot(uniform_filter(down, size), uniform_filter(right, size)) / total
        fits &= (straight > 0.8) & _runs_through(length, size, total)
        score = np.where(fits, total * straight**5, 0.0)
        row, column = np.unravel_index(int(score.argmax()), score.shape)
        if score[row, column] > best[0]:
            top, left = int(row) - size[0] // 2, int(column) - size[1] // 2
            window = (slice(top, top + size[0]), slice(left, left + size[1]))
            best = (float(score[row, column]), window)
    return best[1]


def _runs_through(length: FloatArray, size: tuple[int, int], total: FloatArray) -> BoolArray:
    """Tell where gradients lie along the middle of the window, as much in either half of its length."""
    along = 0 if size[0] > size[1] else 1
    half, middle = list(size), list(size)
    half[along] = size[along] // 2 + 1
    middle[1 - along] = size[1 - along] // 2 + 1
    share = middle[1 - along] / size[1 - along]
    runs = uniform_filter(length, middle) * share > 0.9 * total
    for side in (-1, 1):
        origin = [0, 0]
        origin[along] = side * (size[along] // 4)
        runs &= uniform_filter(length, half, origin=origin) > 0.8 * total
    return np.asarray(runs)


def slanted_edge(
    patch: FloatArray, stderr: FloatArray | None = None, *, seed: int = 0
) -> EdgeResponse | None:
    """Measure the response of the edge that crosses ``patch``.

    Parameters
    ----------
    patch : array (rows, columns)
        One straight edge, dark on one side and bright on the other.
    stderr : array (rows, columns), optional
        Standard error of each pixel; the errors of the results come from repeated draws of it.
    seed : int
        Of those draws.

    Returns
    -------
    EdgeResponse or None
        None when no edge is found or it is so parallel to the pixels that even whole pixels across
        it are not all sampled.
    """
    patch = np.asarray(patch, dtype=np.float64)
    down, right = np.gradient(patch)
    if abs(down.sum()) > abs(right.sum()):
        patch, stderr = patch.T, None if stderr is None else stderr.T
    if patch[:, -1].mean() < patch[:, 0].mean():
        patch, stderr = patch[:, ::-1], None if stderr is None else stderr[:, ::-1]
    line = _edge_line(patch)
    if line is None:
        return None
    step = next((1 / n for n in _OVERSAMPLING if _bins(patch.shape, line, 1 / n)[1].all()), None)
    if step is None:
        return None
    found = _transfer(patch, line, step)
    scatter, half_scatter = np.full(found.mtf.shape, np.nan), math.nan
    if stderr is not None:
        rng = np.random.default_rng(seed)
        draws = [patch + stderr * rng.standard_normal(patch.shape) for _ in range(_RESAMPLES)]
        curves = np.array([_transfer(draw, line, step).mtf for draw in draws])
        scatter = curves.std(axis=0, ddof=1)
        half_scatter = float(np.std([_half_frequency(found.frequency, curve) for curve in curves], ddof=1))
    return EdgeResponse(
        angle=abs(math.atan(line[1])),
        distance=found.distance,
        spread=found.spread,
        frequency=found.frequency,
        mtf=found.mtf,
        mtf_stderr=scatter,
        mtf50=Estimate(_half_frequency(found.frequency, found.mtf), half_scatter),
    )


class _Transfer(NamedTuple):
    distance: FloatArray
    spread: FloatArray
    frequency: FloatArray
    mtf: FloatArray


def _edge_line(patch: FloatArray) -> tuple[float, float] | None:
    """Fit column = a + b * (row - middle) through the centroids of the rows' derivatives."""
    rows = np.arange(patch.shape[0]) - (patch.shape[0] - 1) / 2
    columns = np.arange(patch.shape[1], dtype=np.float64)
    slope = np.gradient(gaussian_filter(patch, (1.0, 0.7)), axis=1)
    middle, tilt = (patch.shape[1] - 1) / 2, 0.0
    for breadth in (1.5 * patch.shape[1], patch.shape[1], 0.6 * patch.shape[1], 0.6 * patch.shape[1]):
        away = columns - (middle + tilt * rows)[:, None]
        weight = np.where(np.abs(away) < breadth / 2, np.cos(np.pi * away / breadth) ** 2, 0.0) * slope
        total = weight.sum(axis=1)
        if (total <= 0).any():
            return None
        tilt, middle = np.polyfit(rows, (weight * columns).sum(axis=1) / total, 1)
    inside = _LEAST_REACH <= middle <= patch.shape[1] - 1 - _LEAST_REACH
    return (float(middle), float(tilt)) if inside else None


def _bins(
    shape: tuple[int, ...], line: tuple[float, float], step: float
) -> tuple[NDArray[np.int_], BoolArray]:
    """Return the bin of every pixel by its distance across the edge, and which bins are filled."""
    rows = np.arange(shape[0]) - (shape[0] - 1) / 2
    away = (np.arange(shape[1]) - (line[0] + line[1] * rows)[:, None]) / math.hypot(1.0, line[1])
    reach = _reach(shape, line)
    index = np.floor((away + reach) / step + 0.5).astype(int)
    count = round(2 * reach / step) + 1
    index = np.where((index >= 0) & (index < count), index, count)
    return index, np.bincount(index.ravel(), minlength=count + 1)[:count] > 0


def _reach(shape: tuple[int, ...], line: tuple[float, float]) -> float:
    """Whole pixels on both sides of the edge that at least half of the patch's rows cover."""
    room = min(line[0], shape[1] - 1 - line[0])
    return float(math.floor(room / math.hypot(1.0, line[1])))


def _transfer(patch: FloatArray, line: tuple[float, float], step: float) -> _Transfer:
    """Sample the edge in steps across it and transform its derivative."""
    index, filled = _bins(patch.shape, line, step)
    size = filled.size
    sums = np.bincount(index.ravel(), patch.ravel(), minlength=size + 1)[:size]
    counts = np.bincount(index.ravel(), minlength=size + 1)[:size]
    spread = np.asarray(sums / np.maximum(counts, 1), dtype=np.float64)
    slope = np.diff(spread) * tukey(size - 1, 0.5)
    padded = 8 * slope.size
    frequency = np.fft.rfftfreq(padded, step)
    transfer = np.abs(np.fft.rfft(slope, padded))
    # The bins average over one step and the difference spans one: both lower the transfer by sinc.
    mtf = transfer / transfer[0] / np.sinc(frequency * step) ** 2
    end = max(1, round(1.0 / step))
    dark, bright = spread[:end].mean(), spread[-end:].mean()
    kept = frequency <= 1.0
    return _Transfer(
        distance=np.asarray((np.arange(size) - size // 2) * step),
        spread=np.asarray((spread - dark) / (bright - dark)),
        frequency=np.asarray(frequency[kept]),
        mtf=np.asarray(mtf[kept]),
    )


def _half_frequency(frequency: FloatArray, mtf: FloatArray) -> float:
    """First frequency at which the modulation has fallen to one half, linearly between samples."""
    below = np.flatnonzero(mtf < 0.5)
    if below.size == 0:
        return math.nan
    after = int(below[0])
    high, low = mtf[after - 1], mtf[after]
    return float(
        frequency[after - 1] + (high - 0.5) / (high - low) * (frequency[after] - frequency[after - 1])
    )
