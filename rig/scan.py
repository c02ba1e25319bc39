"""Sweep the gate's delay over a range, every step verified, with a frame taken at each if wanted.

While nobody looks, the triggers stay off. With a frame to take they are stopped, the delay is moved and
read back, and they are started again, at every step: a wrong byte never meets a running trigger.
"""

from __future__ import annotations

import csv
import os
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, fields, replace
from datetime import UTC, datetime
from fractions import Fraction
from math import ceil
from pathlib import Path

from rig.errors import Fault, PlanError
from rig.generator import Generator
from rig.quantity import Quantity, exact, nearest, seconds
from rig.timing import GatePlan

_PS = 10**12
_MOST_STEPS = 100_000
STEPS_PER_FWHM = {"coarse": 2, "fine": 6}


@dataclass(frozen=True)
class Scan:
    """A planned sweep: one gate at many delays, all on the generator's grid."""

    plan: GatePlan
    requested_ps: tuple[Fraction, ...]
    delays_ps: tuple[int, ...]
    step_ps: int

    @property
    def step_m(self) -> float:
        """The step in range."""
        return self.step_ps * self.plan.metres_per_ps


@dataclass(frozen=True)
class ScanStep:
    """One step as it was requested, sent and read back."""

    index: int
    requested_ps: float
    sent_ps: int
    read_ps: int
    width_ps: int
    distance_m: float
    utc: str
    signal: float | None


def plan_scan(
    plan: GatePlan,
    *,
    start: Quantity | None = None,
    stop: Quantity | None = None,
    step: Quantity | None = None,
    points: int | None = None,
    fineness: str = "coarse",
) -> Scan:
    """Plan a sweep of ``plan``'s gate from ``start`` to ``stop``.

    Parameters
    ----------
    plan : GatePlan
        The gate; its distance fixes what a delay means in range.
    start, stop, step : quantity
        Distances (``"9 m"``) or delays (``"340 ns"``). A constant step in delay is one in range. Without
        ``start`` or ``stop`` the sweep reaches twice the depth of field to that side of the plan's delay.
    points : int, optional
        How many steps, in the place of ``step``.
    fineness : {"coarse", "fine"}
        Without ``step`` and ``points``: half or a sixth of the depth of field (FWHM).

    Raises
    ------
    PlanError
        If the sweep has no points, or goes where a delay cannot be.
    """
    reach_ps = 2 * (plan.pulse_ps + plan.width_ps)
    first = (
        max(plan.wanted_delay_ps - reach_ps, Fraction(0))
        if start is None
        else _delay_at(plan, start, "start")
    )
    last = plan.wanted_delay_ps + reach_ps if stop is None else _delay_at(plan, stop, "stop")
    if last < first:
        raise PlanError("scan", [Fault("stop", repr(stop), f"not before start = {start!r}")])
    grid = plan.model.step_ps
    if points is not None:
        if points < 1:
            raise PlanError("scan", [Fault("points", repr(points), "1 or more")])
        wanted = (last - first) / max(1, points - 1)
    elif step is not None:
        wanted = _length_or_time(plan, step, "step")
    else:
        if fineness not in STEPS_PER_FWHM:
            raise PlanError("scan", [Fault("fineness", repr(fineness), " or ".join(STEPS_PER_FWHM))])
        wanted = max(plan.pulse_ps, Fraction(plan.width_ps)) / STEPS_PER_FWHM[fineness]
    if points is None and wanted <= 0:
        raise PlanError("scan", [Fault("step", repr(step), "more than zero")])
    step_ps = max(1, nearest(wanted, grid)) * grid
    count = points if points is not None else ceil((last - first) / step_ps) + 1
    if count > _MOST_STEPS:
        raise PlanError("scan", [Fault("step", repr(step), f"at most {_MOST_STEPS} steps, not {count}")])
    requested = tuple(first + index * wanted for index in range(count))
    begin = nearest(first, grid) * grid
    delays = tuple(begin + index * step_ps for index in range(count))
    if points is not None:
        delays = tuple(nearest(each, grid) * grid for each in requested)
    if delays[0] < 0:
        wanted_text = f"a delay of zero or more (reach floor {plan.reach_floor_m:.2f} m)"
        raise PlanError("scan", [Fault("start", f"{start!r}, a delay of {delays[0]} ps", wanted_text)])
    return Scan(plan, requested, delays, step_ps)


def run_scan(
    box: Generator,
    scan: Scan,
    *,
    grab: Callable[[ScanStep], float | None] | None = None,
    dwell: Quantity = "0 s",
    trigger: str | None = None,
) -> Iterator[ScanStep]:
    """Sweep, and yield each step once it is read back and its frame is taken.

    The whole sweep is checked before its first byte; after its last step the gate is read once more,
    so that a power cut on the way does not pass.

    Parameters
    ----------
    box : Generator
        Open.
    scan : Scan
    grab : callable, optional
        Called at each step with the triggers running; may return the frame's signal.
    dwell : quantity
        How long each step stays, with the triggers running, for a camera that runs by itself.
    trigger : str, optional
        The source for those two; by default the plan's.

    Raises
    ------
    PlanError, LimitError
        If any step may not be; nothing is sent.
    RigError
        If a step could not be verified; the sweep ends there.
    """
    pause_s = seconds(dwell, name="dwell")
    seen = grab is not None or pause_s > 0
    box.check_range(scan.plan, min(scan.delays_ps), max(scan.delays_ps))
    box.apply(scan.plan.with_delay(scan.delays_ps[0]))
    for index, (requested, delay_ps) in enumerate(zip(scan.requested_ps, scan.delays_ps, strict=True)):
        read_ps = box.move_gate(delay_ps, then_trigger=(trigger or scan.plan.trigger) if seen else None)
        back_ps = float(read_ps + scan.plan.electronics_ps - scan.plan.convention_ps)
        step = ScanStep(
            index=index,
            requested_ps=float(requested),
            sent_ps=delay_ps,
            read_ps=read_ps,
            width_ps=scan.plan.width_ps,
            distance_m=back_ps * scan.plan.metres_per_ps,
            utc=datetime.now(UTC).isoformat(timespec="milliseconds"),
            signal=None,
        )
        if pause_s:
            time.sleep(pause_s)
        if grab is not None:
            signal = grab(step)
            step = replace(step, signal=None if signal is None else float(signal))
        yield step
    box.check_held(scan.delays_ps[-1])


def write_steps(path: str | os.PathLike[str], steps: Iterable[ScanStep]) -> None:
    """Write the steps as CSV, whole or not at all."""
    target = Path(path)
    with tempfile.NamedTemporaryFile(
        "w", newline="", dir=target.parent, prefix=target.name, suffix=".part", delete=False, encoding="utf-8"
    ) as file:
        writer = csv.DictWriter(file, [field.name for field in fields(ScanStep)])
        writer.writeheader()
        writer.writerows(asdict(step) for step in steps)
    Path(file.name).replace(target)


def _delay_at(plan: GatePlan, place: Quantity, name: str) -> Fraction:
    """The delay (ps) whose gate opens when light from ``place`` comes back, or the delay itself."""
    picoseconds = _length_or_time(plan, place, name)
    if _is_time(place):
        return picoseconds
    return picoseconds + plan.convention_ps - plan.electronics_ps


def _length_or_time(plan: GatePlan, value: Quantity, name: str) -> Fraction:
    if _is_time(value):
        return exact(value, "time", name=name) * _PS
    return exact(value, "length", name=name) * plan.ps_per_metre


def _is_time(value: Quantity) -> bool:
    return isinstance(value, str) and value.strip().endswith("s")
