"""Find the target in a sweep: where the signal peaks, in delay and in range, with its uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, sqrt
from statistics import median

from rig.errors import Fault, PlanError
from rig.timing import GatePlan

_FEWEST_STEPS = 5


@dataclass(frozen=True)
class Target:
    """Where a sweep found the target.

    Attributes
    ----------
    delay_ps, delay_stderr_ps : float
        Programmed delay at which the gate's middle meets the middle of the return.
    distance_m, distance_stderr_m : float
        The range that follows, with the noise of the sweep alone.
    uncertainty_m : float
        With that of the gate's position (generator or calibrated offset) as well.
    """

    delay_ps: float
    delay_stderr_ps: float
    distance_m: float
    distance_stderr_m: float
    uncertainty_m: float


def find_target(plan: GatePlan, delays_ps: Sequence[float], signal: Sequence[float]) -> Target:
    """Return the range of the strongest return.

    The signal above half of its height, weighted by what it exceeds that half, has its centroid at the
    delay where gate and return are centred on each other: their correlation is symmetric. The weights
    fall to zero where the window ends, so that the window's own edge brings no bias. Noise is
    estimated from the differences between neighbours outside the peak.

    Parameters
    ----------
    plan : GatePlan
    delays_ps, signal : sequence of float
        One of each per step, in the order of growing delay.

    Raises
    ------
    PlanError
        If there are fewer than five steps, or no peak stands out of the noise, or it touches an end.
    """
    if len(delays_ps) != len(signal) or len(signal) < _FEWEST_STEPS:
        came = f"{len(signal)} signals, {len(delays_ps)} delays"
        raise PlanError("find target", [Fault("sweep", came, f"at least {_FEWEST_STEPS} of each")])
    top = max(range(len(signal)), key=signal.__getitem__)
    ground = median(sorted(signal)[: max(3, len(signal) // 2)])
    half = (signal[top] + ground) / 2
    low = high = top
    while low > 0 and signal[low - 1] > half:
        low -= 1
    while high < len(signal) - 1 and signal[high + 1] > half:
        high += 1
    noise = _noise(signal, low, high)
    if signal[top] - ground <= 5 * noise:
        came = f"a peak of {signal[top] - ground:.3g} over a noise of {noise:.3g}"
        raise PlanError("find target", [Fault("signal", came, "at least five times the noise")])
    if low == 0 or high == len(signal) - 1:
        fault = Fault("sweep", "a peak at its end", "a peak inside", "Sweep farther.")
        raise PlanError("find target", [fault])
    inside = range(low, high + 1)
    weights = [signal[index] - half for index in inside]
    total = sum(weights)
    delay = sum(weight * delays_ps[index] for weight, index in zip(weights, inside, strict=True)) / total
    spread = sqrt(sum((delays_ps[index] - delay) ** 2 for index in inside))
    step = (delays_ps[-1] - delays_ps[0]) / (len(delays_ps) - 1)
    grid = step / sqrt(12) / len(weights)  # where between two steps the window's edges fall
    stderr = hypot(noise * spread / total, grid)
    centred = delay + float(plan.electronics_ps) - (float(plan.pulse_ps) - plan.width_ps) / 2
    per_ps = plan.metres_per_ps
    return Target(
        delay_ps=delay,
        delay_stderr_ps=stderr,
        distance_m=centred * per_ps,
        distance_stderr_m=stderr * per_ps,
        uncertainty_m=hypot(stderr, plan.uncertainty_ps) * per_ps,
    )


def _noise(signal: Sequence[float], low: int, high: int) -> float:
    """Standard deviation of one step, from neighbours outside the peak and its flanks."""
    width = high - low + 1
    outside = [*signal[: max(0, low - width)], *signal[high + width + 1 :]]
    if len(outside) < _FEWEST_STEPS:
        outside = sorted(signal)[:_FEWEST_STEPS]
    differences = [abs(after - before) for before, after in pairwise(outside)]
    return 1.4826 * median(differences) / sqrt(2)
