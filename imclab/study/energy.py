"""Energy of the picture against optical depth, coaxial and with the camera aside (Fig. 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from imclab.result import Flux, Result
from imclab.study.conclusion import Conclusion, Statement
from imclab.study.curves import Point, curves_of
from imclab.study.file import Study
from imclab.study.ratios import difference, ratio, shown
from imclab.uncertainty import Estimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Curves = dict[str, list[Point]]
SIGMAS = 3.0
"""Two numbers differ when they are so many standard errors apart."""
_TICKS = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)


def conclude(study: Study, records: Sequence[Result | Flux]) -> Conclusion:
    """Return table, figure and statements of pictures at several optical depths on each curve.

    Curves are named ``TARGET, PLACEMENT``; one with the camera aside is compared with the coaxial
    one of the same target.
    """
    curves = curves_of(study, records)
    rows = [
        {
            "curve": name,
            "optical_depth": point.optical_depth,
            "energy_J": point.result.total,
            "energy_J_stderr": point.result.total_stderr,
            "normalised": _normalised(points, index).value,
            "normalised_stderr": _normalised(points, index).stderr,
            "unscattered": math.exp(-2.0 * (point.optical_depth - points[0].optical_depth)),
        }
        for name, points in curves.items()
        for index, point in enumerate(points)
    ]
    return Conclusion(
        title=study.title,
        shows=study.shows,
        rows=rows,
        statements=[_falls(curves), *_above(curves)],
        largest_relative_error=max(
            point.result.relative_error for points in curves.values() for point in points
        ),
        cpu_seconds=sum(record.cpu_seconds for record in records),
        figure=_figure(curves),
    )


def _normalised(points: list[Point], index: int) -> Estimate:
    """Return the energy of a point over that of the first."""
    if index == 0:
        return Estimate(1.0, 0.0)
    return ratio(points[index].energy(), points[0].energy())


def _aside(points: list[Point]) -> bool:
    return any(points[0].scene.receiver.position)


def _falls(curves: Curves) -> Statement:
    steps = [
        difference(before.energy(), after.energy())
        for points in curves.values()
        for before, after in pairwise(points)
    ]
    least = min(step.value / step.stderr for step in steps)
    ends = ", ".join(f"{name} {shown(_normalised(points, -1))}" for name, points in curves.items())
    first, last = (next(iter(curves.values()))[index].optical_depth for index in (0, -1))
    return Statement(
        "The energy falls with optical depth.",
        least > SIGMAS,
        f"Left at {last:.2f} of that at {first:.2f}: {ends}; unscattered light alone "
        f"{math.exp(-2.0 * (last - first)):.4f}. The smallest step is {least:.0f} standard errors.",
    )


def _above(curves: Curves) -> list[Statement]:
    statements = []
    for name, points in curves.items():
        coaxial = next(
            (other for key, other in curves.items() if _pair(key, name) and not _aside(other)), None
        )
        if not _aside(points) or coaxial is None:
            continue
        gaps = [
            difference(_normalised(coaxial, index), _normalised(points, index))
            for index in range(1, len(points))
        ]
        ratios = [
            ratio(_normalised(coaxial, i), _normalised(points, i)).value - 1 for i in range(1, len(points))
        ]
        worst = min(gaps, key=lambda gap: gap.value / gap.stderr)
        numbers = (
            f"Coaxial less aside is {shown(gaps[-1])} at the largest depth, and at least "
            f"{worst.value / worst.stderr:.1f} standard errors above zero at every depth; over it by "
            f"{100 * min(ratios):.1f} to {100 * max(ratios):.1f} %."
        )
        text = f"The coaxial simulation lies above the arrangement of the experiment ({name})."
        statements.append(Statement(text, worst.value > SIGMAS * worst.stderr, numbers))
    return statements


def _pair(one: str, other: str) -> bool:
    return one.rpartition(", ")[0] == other.rpartition(", ")[0]


def _figure(curves: Curves) -> Figure:
    """One panel a target, as in the paper."""
    from matplotlib.figure import Figure

    targets = list(dict.fromkeys(name.rpartition(", ")[0] for name in curves))
    figure = Figure(figsize=(4.8 * len(targets), 4.2), layout="constrained")
    panels = figure.subplots(1, len(targets), sharey=True, squeeze=False)[0]
    for axes, target in zip(panels, targets, strict=True):
        alike = {name: points for name, points in curves.items() if name.startswith(f"{target}, ")}
        for name, points in alike.items():
            values = [_normalised(points, index) for index in range(len(points))]
            axes.errorbar(
                [point.optical_depth for point in points],
                [value.value for value in values],
                [value.stderr for value in values],
                marker="s" if _aside(points) else "o",
                markersize=4,
                capsize=2,
                linestyle="--" if _aside(points) else "-",
                label=name.rpartition(", ")[2],
            )
        depths = [point.optical_depth for point in next(iter(alike.values()))]
        unscattered = [math.exp(-2 * (depth - depths[0])) for depth in depths]
        axes.plot(depths, unscattered, ":k", label="unscattered, two ways")
        axes.set(title=target, xlabel="optical depth", yscale="log")
        axes.set_yticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
        axes.set_yticks([], minor=True)
        axes.legend(fontsize="small", title="bars: one standard error", title_fontsize="small")
    panels[0].set_ylabel(f"energy over that at optical depth {depths[0]:g}")
    return figure
