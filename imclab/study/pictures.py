"""Pictures gated and not, clear and turbid, smooth and rough (Figs. 4, 6, 7; Tables 1, 2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from imclab.result import Flux, Result
from imclab.study.conclusion import Conclusion, Row
from imclab.study.curves import Point, curves_of, shown_value
from imclab.study.file import Study
from imclab.study.picture_statements import gating, mssim_above_ssim, roughness, toward_the_experiment
from imclab.study.shots import METRICS, OWN_GAIN, SAME_GAIN, Pair, brightest_of, pairs_of, shot_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_ROWS = 4
"""With more curves than this, two stand side by side."""


def conclude(study: Study, records: Sequence[Result | Flux]) -> Conclusion:
    """Return table, figure and statements of pictures compared with the first of their curve.

    When the roughness varies, brightness and contrast are looked at; else curves named ``TARGET, gated``
    and ``TARGET, not gated`` are compared with one another.
    """
    curves = curves_of(study, records)
    pairs = [pair for name, points in curves.items() for pair in pairs_of(study, name, points)]
    statements = mssim_above_ssim(study, pairs)
    if study.vary is not None and study.vary.key == "target.figure.roughness":
        statements += [found for name, points in curves.items() for found in roughness(name, points)]
    else:
        statements = [*gating(pairs), *toward_the_experiment(study), *statements]
    return Conclusion(
        title=study.title,
        shows=study.shows,
        rows=[*(_row(pair) for pair in pairs), *_printed(study)],
        statements=statements,
        largest_relative_error=max(p.result.relative_error for points in curves.values() for p in points),
        cpu_seconds=sum(record.cpu_seconds for record in records),
        figure=_figure(study, curves),
    )


def _row(pair: Pair) -> Row:
    row: Row = {"curve": pair.curve, "source": f"ours: {pair.light}, {pair.gain}", "compared": pair.value}
    for name, estimate in pair.metrics.items():
        row |= {name: estimate.value, f"{name}_stderr": estimate.stderr}
    return row


def _printed(study: Study) -> list[Row]:
    rows = []
    for printed in study.printed:
        row: Row = {"curve": printed.curve, "source": f"paper: {printed.source}", "compared": ""}
        for name in METRICS:
            row |= {name: getattr(printed, name, ""), f"{name}_stderr": ""}
        rows.append(row)
    return rows


def _panels(study: Study, points: list[Point]) -> list[tuple[str, Point, str]]:
    """Return what a row shows, in order of the varied key: title, picture, and its gain."""
    label = "" if study.vary is None else study.vary.label
    ordered = sorted(points, key=lambda point: float(point.value.split()[0]))
    panels = []
    for point in ordered:
        reference = point is points[0]
        told = f"{label} {shown_value(study, point)}"
        panels.append((f"{told}\n{'reference' if reference else SAME_GAIN}", point, SAME_GAIN))
        if not reference and point is points[1]:
            panels.append((f"{told}\n{OWN_GAIN}", point, OWN_GAIN))
    return panels


def _figure(study: Study, curves: dict[str, list[Point]]) -> Figure:
    from matplotlib.figure import Figure

    rows = {name: _panels(study, points) for name, points in curves.items()}
    beside = 2 if len(rows) > MOST_ROWS else 1
    columns = max(len(panels) for panels in rows.values())
    lines = math.ceil(len(rows) / beside)
    figure = Figure(figsize=(1.9 * columns * beside + 1.0, 2.2 * lines), layout="constrained")
    grid = figure.subplots(lines, columns * beside, squeeze=False)
    drawn: Any = None
    for number, (name, panels) in enumerate(rows.items()):
        first = columns * (number % beside)
        places = grid[number // beside, first : first + columns]
        places[0].set_ylabel(name, fontsize="small")
        reference = brightest_of(curves[name][0], "energy")
        for axes, (title, point, gain) in zip(places, panels, strict=False):
            scale = reference if gain == SAME_GAIN else brightest_of(point, "energy")
            shot = shot_of(study.detector, point, "energy", scale)
            drawn = axes.imshow(shot.counts, cmap="gray", vmin=0, vmax=shot.full_scale)
            axes.set_title(title, fontsize="small")
    for axes in grid.flat:
        axes.set(xticks=[], yticks=[])
    figure.colorbar(drawn, ax=grid, label="counts", shrink=0.6, aspect=40, pad=0.01)
    return figure
