"""The echo against time, target and backscatter apart, and what the gate leaves of it (Fig. 3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imclab.errors import Fault, InputError
from imclab.result import Flux, Result
from imclab.study.conclusion import Conclusion, Row, Statement
from imclab.study.curves import Point, curves_of
from imclab.study.file import Study
from imclab.study.ratios import difference, ratio, shown
from imclab.uncertainty import Estimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Curves = dict[str, list[Point]]
FloatArray = NDArray[np.float64]
WHOLE, DARK, GATED = "not gated", "not gated, black target", "gated"


def conclude(study: Study, records: Sequence[Result | Flux]) -> Conclusion:
    """Return table, figure and statements of the three curves `WHOLE`, `DARK` and `GATED`.

    Over a black target nothing but backscatter returns, and the light that a real target adds is what
    has touched it: the difference of the two curves is the target's echo.
    """
    curves = curves_of(study, records)
    missing = [name for name in (WHOLE, DARK, GATED) if name not in curves]
    if missing:
        raise InputError(study.name, [Fault("curve", "no such curve", f'a curve "{m}"') for m in missing])
    return Conclusion(
        title=study.title,
        shows=study.shows,
        rows=[row for name in (WHOLE, GATED) for point in curves[name] for row in [_row(name, point)]],
        statements=[_grows(curves), _gate_removes(curves), _target_kept(curves)],
        largest_relative_error=max(_worst_bin(point) for point in [*curves[WHOLE], *curves[DARK]]),
        cpu_seconds=sum(record.cpu_seconds for record in records),
        figure=_figure(curves),
    )


def _row(name: str, point: Point) -> Row:
    row: Row = {"curve": name, "optical_depth": point.optical_depth}
    for part in ("target_total", "backscatter_total"):
        estimate = point.energy(part)
        row |= {f"{part}_J": estimate.value, f"{part}_J_stderr": estimate.stderr}
    over = _over_target(point)
    return row | {"backscatter_over_target": over.value, "backscatter_over_target_stderr": over.stderr}


def _over_target(point: Point) -> Estimate:
    """Backscatter over target light; nought without an error when the gate shuts all backscatter out."""
    backscatter = point.energy("backscatter_total")
    return ratio(backscatter, point.energy("target_total")) if backscatter.value > 0 else Estimate(0.0, 0.0)


def _grows(curves: Curves) -> Statement:
    first, last = _over_target(curves[WHOLE][0]), _over_target(curves[WHOLE][-1])
    step = difference(last, first)
    return Statement(
        "With the optical depth the weight of backscatter grows, without a gate.",
        step.value > 3 * step.stderr,
        f"Backscatter over target light: {shown(first)}, then {shown(last)}.",
    )


def _gate_removes(curves: Curves) -> Statement:
    pairs = list(zip(curves[WHOLE], curves[GATED], strict=True))
    numbers = "; ".join(
        f"at {open_.optical_depth:.2f} from {shown(_over_target(open_))} to {shown(_over_target(gated))}"
        for open_, gated in pairs
    )
    less = all(_over_target(gated).value < 0.1 * _over_target(open_).value for open_, gated in pairs)
    return Statement(
        "The gate takes away the influence of the backscatter (by more than nine tenths).",
        less,
        f"Backscatter over target light falls {numbers}.",
    )


def _target_kept(curves: Curves) -> Statement:
    shares = [
        ratio(gated.energy("target_total"), open_.energy("target_total"))
        for open_, gated in zip(curves[WHOLE], curves[GATED], strict=True)
    ]
    numbers = ", ".join(shown(share, percent=True) for share in shares)
    text = "The gate keeps the signal of the target (more than half of it)."
    return Statement(text, all(share.value > 0.5 for share in shares), f"It keeps {numbers}.")


def _power(point: Point) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times (s), power and its standard error (W)."""
    result = point.result
    if result.time_edges is None or result.time_energy is None or result.time_stderr is None:
        raise InputError("echo", [Fault("time", "no time histogram", "a run with time bins")])
    widths = np.diff(result.time_edges)
    times = 0.5 * (result.time_edges[1:] + result.time_edges[:-1])
    return times, result.time_energy / widths, result.time_stderr / widths


def _worst_bin(point: Point) -> float:
    _, power, stderr = _power(point)
    return float(stderr.max() / power.max())


def _figure(curves: Curves) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 6), layout="constrained")
    panels = figure.subplots(2, len(curves[WHOLE]), squeeze=False)
    for column, (whole, dark, gated) in enumerate(
        zip(curves[WHOLE], curves[DARK], curves[GATED], strict=True)
    ):
        times, power, _ = _power(whole)
        _, backscatter, _ = _power(dark)
        peak, end = power.max(), 1e9 * times[-1]
        above, below = panels[0, column], panels[1, column]
        above.plot(1e9 * times, power / peak, "k", label="all light")
        above.plot(1e9 * times, backscatter / peak, "C0--", label="backscatter")
        above.plot(1e9 * times, (power - backscatter) / peak, "C3--", label="target")
        above.set_title(f"optical depth {whole.optical_depth:.2f}, not gated")
        times, power, _ = _power(gated)
        shut = np.array([0.0])
        times = np.concatenate([times[:1], times, times[-1:]])
        below.plot(
            1e9 * times, np.concatenate([shut, power / peak, shut]), "C3", label="what the gate passes"
        )
        below.set_title(f"optical depth {gated.optical_depth:.2f}, gated")
        for axes in (above, below):
            axes.set(xlim=(0, end), ylabel="power over the peak")
            axes.legend(fontsize="small")
        below.set_xlabel("time since the pulse's peak entered the water (ns)")
    return figure
