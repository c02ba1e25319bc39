"""The plot of a sweep: energy, or transmitted share, against the key with the most values."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from imclab.files import written_whole
from imclab.sweep.outcome import Outcome, Row
from imclab.units import si_unit_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_LINES = 12
"""More lines than this are drawn without a legend."""


def save_plot(outcome: Outcome, path: Path) -> None:
    """Draw finished units with error bars (one standard error); no file when nothing is finished."""
    if outcome.records:
        with written_whole(path) as temporary:
            figure_of(outcome).savefig(temporary, dpi=150, format="png")


def figure_of(outcome: Outcome) -> Figure:
    """Return the plot of what is finished; something must be."""
    from matplotlib.figure import Figure

    rows = [row for row in outcome.rows() if row["status"] == "done"]
    one_way = "distance" in rows[0]
    y, label = ("transmitted", "transmitted share") if one_way else ("total", "energy through the gate (J)")
    keys = [*outcome.units[0].changes, *(["distance"] if one_way else [])]
    x = max(keys, key=lambda key: _spread(rows, key)) if keys else "unit"
    others = _telling_apart(rows, x, [key for key in keys if key != x])
    lines: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        lines.setdefault(tuple(row[key] for key in others), []).append(row)

    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.add_subplot()
    for values, unsorted in lines.items():
        line = sorted(unsorted, key=lambda row: row[x]) if _numeric(rows, x) else unsorted
        name = ", ".join(_named(outcome, key, value) for key, value in zip(others, values, strict=True))
        axes.errorbar(
            [row[x] for row in line],
            [row[y] for row in line],
            [row[f"{y}_stderr"] for row in line],
            marker="o",
            markersize=3,
            capsize=2,
            label=name or None,
        )
    heights = np.array([row[y] for row in rows])
    if heights.min() > 0 and heights.max() > 10 * heights.min():
        axes.set_yscale("log")
    unit = _unit(outcome, x)
    axes.set_xlabel(f"{x} ({unit})" if unit else x)
    axes.set_ylabel(label)
    axes.set_title("error bars: one standard error", fontsize="small", loc="right")
    if others and len(lines) <= MOST_LINES:
        figure.legend(fontsize="small", loc="outside lower center", ncols=2)
    return figure


def _telling_apart(rows: list[Row], x: str, keys: list[str]) -> list[str]:
    """Return the keys that lines need: not those of one value, nor those that follow from the others.

    A zipped list follows from the one that it runs beside, a curve's changes from its name.
    """
    needed = list(keys)
    for key in reversed(keys):
        fewer = [other for other in needed if other != key]
        if _combinations(rows, [x, *fewer]) == _combinations(rows, [x, *needed]):
            needed = fewer
    return needed


def _combinations(rows: list[Row], keys: list[str]) -> int:
    return len({tuple(row[key] for key in keys) for row in rows})


def _named(outcome: Outcome, key: str, value: Any) -> str:
    shown = f"{value:.4g}" if isinstance(value, float) else f"{value}"
    return " ".join(part for part in (key, shown, _unit(outcome, key)) if part)


def _unit(outcome: Outcome, key: str) -> str:
    """Return the SI unit of a swept key, from how its values were given."""
    if key == "distance":
        return "m"
    given = next((unit.changes[key] for unit in outcome.units if unit.changes.get(key) is not None), None)
    return si_unit_of(given)


def _numeric(rows: list[Row], key: str) -> bool:
    return all(isinstance(row[key], (int, float)) for row in rows)


def _spread(rows: list[Row], key: str) -> tuple[bool, int]:
    return _numeric(rows, key), len({row[key] for row in rows})
