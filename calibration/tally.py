"""What a run of equal frames leaves behind, gathered picture by picture: means, noise, neighbours.

Temporal noise is taken from the differences of successive frames (von Neumann), each with its
local mean removed, so that a lamp that drifts slowly does not pass for noise. The memory is a few
pictures, however long the run is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.fft
from numpy.typing import NDArray

LAG_REACH = 5  # pixels; a spread of 1 px leaves 1 part in 500 of its correlation outside
LAG_PAIRS = 2  # frame pairs of each run that the neighbour covariance is taken from, at least;
LAG_PIXELS = 400_000  # more of small frames (all runs are pooled)
OUTLIER_SIGMAS = 6.0

Floats = NDArray[np.float64]
Map = NDArray[np.float32]


@dataclass(frozen=True)
class Region:
    """The pixels that statistics are taken over: a mask, and its cutting into square blocks."""

    mask: NDArray[np.bool_]

    @cached_property
    def weights(self) -> Map:
        """The mask as 0 and 1."""
        return self.mask.astype(np.float32)

    @cached_property
    def pixels(self) -> int:
        """Number of pixels in the region."""
        return int(self.mask.sum())

    @cached_property
    def blocks(self) -> int:
        """Blocks along each side: their scatter gives standard errors without a noise model."""
        return 8 if min(self.mask.shape) >= 256 else 4

    @cached_property
    def block_pixels(self) -> Floats:
        """Pixels of the region in each block."""
        return self.block_sums(self.weights)

    @cached_property
    def lag_pairs(self) -> Floats:
        """Number of pixel pairs at each lag."""
        return _lag_products(self.weights)

    def mean(self, picture: Map) -> float:
        """Mean of a picture over the region."""
        return float(np.dot(picture.ravel(), self.weights.ravel())) / self.pixels

    def mean_with_stderr(self, picture: Map) -> tuple[float, float]:
        """Mean over the region, and its standard error from the scatter of the blocks."""
        full = self.block_pixels > 0.2 * self.block_pixels.max()
        means = self.block_sums(picture * self.weights)[full] / self.block_pixels[full]
        return self.mean(picture), float(np.std(means, ddof=1) / np.sqrt(means.size))

    def lost_to_block_means(self, lags: Floats) -> float:
        """Variance that taking off each block's mean removes from noise that neighbours share."""
        pixels = float(np.median(self.block_pixels))
        height, width = (length // self.blocks for length in self.mask.shape)
        share = pixels / (height * width)
        return float(share * (lags.sum() - lags[LAG_REACH, LAG_REACH]) / pixels)

    def block_sums(self, picture: Map) -> Floats:
        """Sum of a picture over each block; edges that do not fill a block are left out."""
        count = self.blocks
        height, width = (length // count for length in picture.shape)
        strips = picture[: count * height, : count * width].reshape(count, height, count * width).sum(axis=1)
        return np.asarray(strips.reshape(count, count, width).sum(axis=2, dtype=np.float64))


def _lag_products(picture: Map) -> Floats:
    """Sum of picture(p) * picture(p + lag) over all p, for every lag up to ``LAG_REACH``."""
    shape = [scipy.fft.next_fast_len(length + LAG_REACH, real=True) for length in picture.shape]
    spectrum = scipy.fft.rfft2(picture, shape)
    power = spectrum.real**2 + spectrum.imag**2
    products = scipy.fft.irfft2(power, shape)
    lags = np.arange(-LAG_REACH, LAG_REACH + 1)
    return np.asarray(products[np.ix_(lags, lags)], dtype=np.float64)


@dataclass(frozen=True)
class RunStatistics:
    """The statistics of one run of equal frames, outlier frames left out.

    ``mean`` and ``variance`` (temporal, of one pixel) in counts, with standard errors; ``lags`` is
    the covariance of the temporal noise of two pixels against their distance, ``lag_count`` the
    number of frame pairs in it.
    """

    frames: int
    mean: float
    mean_stderr: float
    variance: float
    variance_stderr: float
    lags: Floats
    lag_count: int
    pixels: int
    largest: float
    share_at_largest: float
    share_at_zero: float
    outliers: tuple[int, ...]
    frame_means: Floats

    def with_variance(self, variance: float, stderr: float) -> RunStatistics:
        """The same statistics with the variance of one pixel taken over better pixels."""
        lags = self.lags.copy()
        lags[LAG_REACH, LAG_REACH] = variance
        return replace(self, variance=variance, variance_stderr=stderr, lags=lags)


class Tally:
    """Gathers one run of frames.

    Parameters
    ----------
    region : Region
        Pixels that the statistics are taken over.
    dark : Map, optional
        Subtracted from every picture.
    keep_mean, keep_noise : bool
        Whether to gather the mean picture and the picture of the temporal variance.
    """

    def __init__(
        self, region: Region, *, dark: Map | None = None, keep_mean: bool = False, keep_noise: bool = False
    ) -> None:
        shape = region.mask.shape
        self._region = region
        self._dark = dark
        self._sum: Floats | None = np.zeros(shape) if keep_mean else None
        self._noise = JumpTally(shape) if keep_noise else None
        self._previous: Map | None = None
        self._means: list[float] = []
        self._pairs: list[Floats] = []
        self._lags: list[Floats] = []
        self._largest = -np.inf
        self._at_largest = 0
        self._at_zero = 0

    def add(self, picture: NDArray[np.generic]) -> None:
        """Take in one picture of raw counts."""
        self._count_ends(picture)
        counts: Map = picture.astype(np.float32)
        if self._dark is not None:
            counts -= self._dark
        self._means.append(self._region.mean(counts))
        if self._sum is not None:
            self._sum += counts
        if self._previous is not None:
            self._add_pair(counts - self._previous)
        self._previous = counts

    def _count_ends(self, picture: NDArray[np.generic]) -> None:
        largest = float(picture.max())  # type: ignore[arg-type]
        if largest > self._largest:
            self._largest, self._at_largest = largest, 0
        if largest == self._largest:
            self._at_largest += int(np.count_nonzero(picture == largest))
        self._at_zero += picture.size - int(np.count_nonzero(picture))

    def _add_pair(self, jump: Map) -> None:
        region = self._region
        if self._noise is not None:
            self._noise.add(jump)
        weighted = jump * region.weights
        pixels = np.maximum(region.block_pixels, 2.0)
        sums = region.block_sums(weighted)
        squares = region.block_sums(weighted * jump)
        self._pairs.append(0.5 * (squares - sums**2 / pixels) / (pixels - 1.0))
        if len(self._lags) < max(LAG_PAIRS, LAG_PIXELS // region.pixels):
            self._lags.append(_lag_covariance(jump, weighted, region))

    @property
    def count(self) -> int:
        """Number of pictures taken in."""
        return len(self._means)

    def mean_map(self) -> Map:
        """Give the mean picture."""
        assert self._sum is not None
        return (self._sum / len(self._means)).astype(np.float32)

    def noise_map(self, *, trimmed: bool) -> Map:
        """Give the temporal variance of each pixel; ``trimmed``: its two largest jumps left out."""
        assert self._noise is not None
        return self._noise.trimmed_variance() if trimmed else self._noise.variance()

    def statistics(self) -> RunStatistics:
        """Sum up the run."""
        means = np.array(self._means)
        pixel_variance = float(np.mean(self._pairs)) if self._pairs else np.nan
        outliers = _outlying(means, pixel_variance / self._region.pixels)
        good = np.setdiff1d(np.arange(means.size), outliers)
        pairs = [
            pair for index, pair in enumerate(self._pairs) if not {index, index + 1}.intersection(outliers)
        ] or self._pairs
        full = self._region.block_pixels > 0.2 * self._region.block_pixels.max()
        blocks = np.mean([pair[full] for pair in pairs], axis=0) if pairs else np.full(2, np.nan)
        weights = self._region.block_pixels[full] if pairs else np.ones(2)
        lags = np.mean(self._lags, axis=0) if self._lags else np.zeros((2 * LAG_REACH + 1,) * 2)
        lost = self._region.lost_to_block_means(lags)
        variance = float(np.average(blocks, weights=weights)) + lost
        kept = means[good]
        scatter = float(np.var(kept, ddof=1)) / kept.size if kept.size > 1 else 0.0
        floor = (variance if np.isfinite(variance) else 0.0) / (self._region.pixels * kept.size)
        total = means.size * self._region.mask.size
        return RunStatistics(
            frames=means.size,
            mean=float(kept.mean()),
            mean_stderr=float(np.sqrt(max(scatter, floor))),
            variance=variance,
            variance_stderr=float(np.std(blocks, ddof=1) / np.sqrt(blocks.size)),
            lags=lags,
            lag_count=len(self._lags),
            pixels=self._region.pixels,
            largest=self._largest,
            share_at_largest=self._at_largest / total,
            share_at_zero=self._at_zero / total,
            outliers=tuple(int(index) for index in outliers),
            frame_means=means,
        )


def _lag_covariance(jump: Map, weighted: Map, region: Region) -> Floats:
    """Covariance of the temporal noise at each lag, from the difference of two frames.

    Taking the mean of n pixels off lowers every lag's covariance by (sum over lags)/n: undone.
    """
    per_block = float(np.median(region.block_pixels))
    if per_block >= 4096.0:
        means = region.block_sums(weighted) / np.maximum(region.block_pixels, 1.0)
        height, width = (length // region.blocks for length in jump.shape)
        local = np.kron(means, np.ones((height, width))).astype(np.float32)
        rest = tuple((0, whole - part) for whole, part in zip(jump.shape, local.shape, strict=True))
        level: Map | np.float32 = np.pad(local, rest, mode="edge")
        removed = per_block
    else:
        level = np.float32(weighted.sum(dtype=np.float64) / region.pixels)
        removed = float(region.pixels)
    centred = (jump - level) * region.weights
    covariance = 0.5 * _lag_products(centred) / np.maximum(region.lag_pairs, 1.0)
    shortfall = covariance.sum() / removed / (1.0 - covariance.size / removed)
    return np.asarray(covariance + shortfall)


def _outlying(means: Floats, noise_of_mean: float) -> NDArray[np.intp]:
    """Frames whose mean is far from the others' median (at least four frames are needed to tell)."""
    if means.size < 4:
        return np.array([], dtype=np.intp)
    distance = np.abs(means - np.median(means))
    usual = 1.4826 * float(np.median(distance))
    floor = np.sqrt(noise_of_mean) if np.isfinite(noise_of_mean) else 0.0
    # The spread of few frames is itself uncertain: the limit widens as 1 + 10/n.
    limit = OUTLIER_SIGMAS * (1.0 + 10.0 / means.size) * max(usual, floor)
    return np.flatnonzero(distance > limit + 1e-3 * abs(np.median(means)))


class JumpTally:
    """Temporal variance per pixel with the two largest jumps set aside.

    One ion spot makes two jumps (up and down); a blinking pixel makes many.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._squares = np.zeros(shape, dtype=np.float32)
        self._first = np.zeros(shape, dtype=np.float32)
        self._second = np.zeros(shape, dtype=np.float32)
        self._count = 0

    def add(self, jump: Map) -> None:
        """Take in the difference of two successive frames."""
        square = jump * jump
        self._squares += square
        lower = np.minimum(square, self._first)
        np.maximum(square, self._first, out=self._first)
        np.maximum(lower, self._second, out=self._second)
        self._count += 1

    def variance(self) -> Map:
        """Give the temporal variance of each pixel."""
        return np.asarray(self._squares / np.float32(2 * max(self._count, 1)))

    def trimmed_variance(self) -> Map:
        """Give the variance without the two largest jumps; with fewer than five jumps all of it."""
        if self._count < 5:
            return self.variance()
        return np.asarray(0.5 * (self._squares - self._first - self._second) / np.float32(self._count - 2))
