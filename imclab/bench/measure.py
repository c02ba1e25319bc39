"""One measured run: its time, its stated and its true errors, for the total and for pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imclab.result import Result
from imclab.scene import Scene
from imclab.transport import simulate

FEWEST_ARRIVALS_ERROR = 0.1
"""A run whose own relative error is above this rests on fewer than a hundred arrivals."""
BRIGHT = 0.01
"""Pixels count that hold at least this part of the reference's brightest pixel."""

MEDIAN_OF_NORMAL = 0.6744897501960817
"""Median of the absolute value of a standard normal: a median error over it is a standard deviation."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """Relative errors of one run beside its time; ``z_total`` judges it against the reference.

    ``own_error`` is the stated error of the total over the run's own total, not the reference's: near 1
    when all rests on one arrival, and then the run judges nothing.
    """

    scene: str
    estimator: str
    seed: int
    packets: int
    cpu_seconds: float
    wall_seconds: float
    z_total: float
    own_error: float
    total_true: float
    total_stated: float
    median_pixel_true: float
    median_pixel_stated: float
    rms_pixel_true: float
    rms_pixel_stated: float


def measured(name: str, scene: Scene, reference: Result, *, estimator: str, packets: float, seed: int) -> Run:
    """Run an estimator for so many packets, so in 32 batches or more, and compare with the reference."""
    result = simulate(scene, estimator=estimator, packets=packets, seed=seed, threads=1, time_bins=0)
    bright = reference.energy >= BRIGHT * reference.energy.max()
    true = _relative(result.energy - reference.energy, reference.energy, bright)
    stated = _relative(result.energy_stderr, reference.energy, bright)
    difference = result.total - reference.total
    error = math.hypot(result.total_stderr, reference.total_stderr)
    return Run(
        scene=name,
        estimator=estimator,
        seed=seed,
        packets=result.packets,
        cpu_seconds=result.cpu_seconds,
        wall_seconds=result.wall_seconds,
        z_total=difference / error if error > 0.0 else math.inf * difference if difference else 0.0,
        own_error=result.relative_error,
        total_true=abs(difference) / reference.total if reference.total > 0.0 else math.nan,
        total_stated=result.total_stderr / reference.total if reference.total > 0.0 else math.nan,
        median_pixel_true=_median(true) / MEDIAN_OF_NORMAL,
        median_pixel_stated=_median(stated),
        rms_pixel_true=_rms(true),
        rms_pixel_stated=_rms(stated),
    )


def _relative(
    error: NDArray[np.float64], energy: NDArray[np.float64], bright: NDArray[np.bool_]
) -> NDArray[np.float64]:
    return np.abs(error[bright]) / energy[bright]


def _median(values: NDArray[np.float64]) -> float:
    return float(np.median(values)) if values.size else math.nan


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else math.nan


def summary(runs: list[Run]) -> dict[str, Any]:
    """Return what the runs of one estimator on one scene say together.

    ``slope`` is that of log error against log seconds, -1/2 for a Monte Carlo estimator;
    ``figure_of_merit`` is 1 / (relative variance x CPU seconds), the mean over the runs by the stated
    variance; seconds to 1 % follow from it. The true error is the root mean square over runs, in units
    of the stated one: 1 when the stated error is true. Runs of too few arrivals are left out.
    """
    first = runs[0]
    combined: dict[str, Any] = {"scene": first.scene, "estimator": first.estimator, "runs": len(runs)}
    combined["packets_per_cpu_second"] = sum(r.packets for r in runs) / sum(r.cpu_seconds for r in runs)
    runs = [run for run in runs if run.own_error <= FEWEST_ARRIVALS_ERROR]
    seconds = np.array([run.cpu_seconds for run in runs])
    for kind in ("total", "median_pixel", "rms_pixel"):
        stated = np.array([getattr(run, f"{kind}_stated") for run in runs])
        true = np.array([getattr(run, f"{kind}_true") for run in runs])
        cost = float(np.median(stated**2 * seconds)) if runs else math.nan
        combined[kind] = {
            "figure_of_merit": 1.0 / cost if cost else math.inf,
            "cpu_seconds_to_1_percent": cost / 1e-4,
            "true_over_stated": _rms(true / stated) if stated.all() else math.nan,
            "slope": _slope(seconds, stated),
        }
    return combined


def _slope(seconds: NDArray[np.float64], error: NDArray[np.float64]) -> float:
    usable = (error > 0.0) & np.isfinite(error) & (seconds > 0.0)
    if usable.sum() < 2 or np.ptp(np.log(seconds[usable])) == 0.0:
        return math.nan
    return float(np.polyfit(np.log(seconds[usable]), np.log(error[usable]), 1)[0])
