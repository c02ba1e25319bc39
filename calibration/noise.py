"""Photon transfer: noise against signal, and what the neighbours have to do with it.

In exposure x (energy times relative gain) the light's own noise has the variance kappa x, whatever
the response does to it afterwards; in counts it is kappa x (dy/dx)^2 on top of the dark noise.
EMVA 1288 release 4: conversion gain K = kappa dy/dx, counts per event. With an intensifier an
"event" is neither a photoelectron nor independent of its neighbours: its excess noise raises the
variance by F^2, and the spread of each event over several pixels lowers the variance of one pixel
by the sum of the noise correlation over all distances. The second is measured here and undone; the
first cannot be told from photon transfer, so that only QE/F^2 follows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class TransferPoints:
    """Photon transfer points of one setting.

    ``variance`` (counts squared) of one pixel against time with its standard error; ``lever`` is
    x (dy/dx)^2 at each point; ``lags`` the noise covariance against distance, ``pixels`` how many
    pixel pairs each is averaged over.
    """

    variance: Floats
    variance_stderr: Floats
    lever: Floats
    lags: Floats
    pixels: Floats
    dark_variance: float
    dark_variance_stderr: float
    dark_lags: Floats


@dataclass(frozen=True)
class Transfer:
    """Noise of one setting.

    Attributes
    ----------
    read_variance, read_variance_stderr : float
        Dark temporal variance of one pixel, counts squared, quantisation included.
    shot, shot_stderr : float
        kappa: variance per exposure, in the unit of the exposure.
    correlation : Floats
        Correlation of the light's noise between pixels against their distance (odd square).
    spread, spread_stderr : float
        Sum of that correlation: 1 without spreading; the factor by which photon transfer of single
        pixels overstates the number of events.
    outliers : tuple of int
        Points that did not fit and hardly counted.
    """

    read_variance: float
    read_variance_stderr: float
    shot: float
    shot_stderr: float
    correlation: Floats
    spread: float
    spread_stderr: float
    outliers: tuple[int, ...]


def fit_transfer(points: TransferPoints) -> Transfer:
    """Fit dark variance and shot noise to the points, outliers weighing little (Huber)."""
    variance = np.append(points.variance, points.dark_variance)
    lever = np.append(points.lever, 0.0)
    error = np.append(np.hypot(points.variance_stderr, 2e-3 * points.variance), points.dark_variance_stderr)
    scale = float(lever.max()) or 1.0
    design = np.stack([np.ones(lever.size), lever / scale], axis=1) / error[:, None]
    target = variance / error
    weight = np.ones(lever.size)
    for _ in range(8):
        spread = np.linalg.inv((design * weight[:, None]).T @ design)
        line = spread @ (design * weight[:, None]).T @ target
        rest = target - design @ line
        weight = np.minimum(1.0, 3.0 / np.maximum(np.abs(rest), 1e-9))
    freedom = max(1, lever.size - 2)
    birge = max(1.0, float((weight * rest**2).sum()) / freedom)
    correlation, total, total_stderr = _spread(points)
    return Transfer(
        read_variance=float(max(line[0], 0.0)),
        read_variance_stderr=float(np.sqrt(spread[0, 0])),
        shot=float(max(line[1], 0.0) / scale),
        shot_stderr=float(np.sqrt(spread[1, 1] * birge) / scale),
        correlation=correlation,
        spread=total,
        spread_stderr=total_stderr,
        outliers=tuple(int(index) for index in np.flatnonzero(weight[:-1] < 0.5)),
    )


def _spread(points: TransferPoints) -> tuple[Floats, float, float]:
    """Pool the noise correlation of all runs and sum it out to where it has died away."""
    reach = points.dark_lags.shape[0] // 2
    light = points.lags - points.dark_lags
    own = light[:, reach, reach]
    usable = own > 0.05 * points.lags[:, reach, reach]
    if not usable.any():
        alone = np.zeros_like(points.dark_lags)
        alone[reach, reach] = 1.0
        return alone, 1.0, 0.0
    light, own = light[usable], own[usable]
    total = points.lags[usable, reach, reach]
    weight = points.pixels[usable] * (own / total) ** 2
    correlation = np.tensordot(weight / weight.sum(), light / own[:, None, None], axes=1)
    # Standard error of one lag's correlation, after Bartlett: sqrt(sum of squared correlations / n).
    one_lag = np.sqrt(float((correlation**2).sum()) / weight.sum())
    row, column = np.indices(correlation.shape) - reach
    ring = np.maximum(np.abs(row), np.abs(column))
    sums = np.array([correlation[ring == radius].sum() for radius in range(reach + 1)])
    # Each lag and its mirror image are one and the same number, hence the factor 2.
    errors = one_lag * np.sqrt(2.0 * np.array([np.sum(ring == radius) for radius in range(reach + 1)]))
    # A spread event shares its noise with all rings out to where it ends: the first ring that shows
    # nothing ends the sum, or chance far out would enter it.
    silent = np.flatnonzero(sums[1:] < 3.0 * errors[1:])
    last = int(silent[0]) if silent.size else reach
    kept = np.where(ring <= last, correlation, 0.0)
    error = float(np.sqrt((errors[1 : last + 1] ** 2).sum() + errors[min(last + 1, reach)] ** 2 / 4.0))
    return kept, max(float(kept.sum()), 1e-3), error


class EventEnergy(NamedTuple):
    """Energy at the photocathode per event, and the share of it due to the sensor's own shot noise."""

    energy: float
    stderr: float
    sensor: float


def event_energy(per_setting: Floats, stderr: Floats, gain: Floats) -> EventEnergy:
    """Separate the intensifier's events from the sensor's own shot noise.

    The variance per energy and gain, q(G) = q + c/G: the part q is the light's events (it becomes
    QE/F^2), c the shot noise of the sensor behind the intensifier, which a high gain drowns. c is
    let in only where the settings differ by more than their errors without it (2 sigma).

    Parameters
    ----------
    per_setting, stderr : Floats
        kappa times spread over G at each setting, J.
    gain : Floats
        Relative gain of each setting.
    """
    design = np.stack([np.ones(gain.size), gain.max() / gain], axis=1) / stderr[:, None]
    target = per_setting / stderr
    weight = float(design[:, 0] @ design[:, 0])
    alone = float(design[:, 0] @ target) / weight
    misfit = float(np.sum((target - alone * design[:, 0]) ** 2))
    if gain.size > 1:
        both, _ = optimize.nnls(design, target)
        rest = float(np.sum((target - design @ both) ** 2))
        if both.min() > 0.0 and misfit - rest > 4.0:
            spread = np.linalg.inv(design.T @ design)
            birge = max(1.0, rest / max(1, gain.size - 2))
            return EventEnergy(
                float(both[0]), float(np.sqrt(spread[0, 0] * birge)), float(both[1] * gain.max())
            )
    birge = max(1.0, misfit / max(1, gain.size - 1))
    return EventEnergy(alone, float(np.sqrt(birge / weight)), 0.0)


def spreading_kernel(correlation: Floats) -> Floats:
    """Give the kernel (sum 1) that turns independent events into noise of this correlation.

    The zero-phase square root of the noise spectrum.
    """
    reach = correlation.shape[0] // 2
    size = 4 * reach + 1
    padded = np.zeros((size, size))
    padded[: 2 * reach + 1, : 2 * reach + 1] = correlation
    padded = np.roll(padded, (-reach, -reach), axis=(0, 1))
    power = np.maximum(np.fft.fft2(padded).real, 0.0)
    kernel = np.fft.fftshift(np.fft.ifft2(np.sqrt(power)).real)
    middle = kernel[reach : 3 * reach + 1, reach : 3 * reach + 1]
    return np.asarray(middle / middle.sum())
