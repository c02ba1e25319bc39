"""The plot of a sweep: energy, or transmitted share, against the key with the most values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from imclab.files import written_whole
from imclab.sweep.outcome import Outcome, Row

MOST_LINES = 12
"""More lines than this are drawn without a legend."""


def save_plot(outcome: Outcome, path: Path) -> None:
    """Draw finished units with error bars (one standard error); no file when nothing is finished."""
    rows = [row for row in outcome.rows() if row["status"] == "done"]
    if not rows:
        return
    from matplotlib.figure import Figure

    one_way = "distance" in rows[0]
    y, label = ("transmitted", "transmitted share") if one_way else ("total", "energy through the gate (J)")
    keys = [*outcome.units[0].changes, *(["distance"] if one_way else [])]
    x = max(keys, key=lambda key: _spread(rows, key)) if keys else "unit"
    others = [key for key in keys if key != x]
    lines: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        lines.setdefault(tuple(row[key] for key in others), []).append(row)

    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.add_subplot()
    for values, unsorted in lines.items():
        line = sorted(unsorted, key=lambda row: row[x]) if _numeric(rows, x) else unsorted
        name = ", ".join(
            f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
            for key, value in zip(others, values, strict=True)
        )
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
    axes.set_xlabel(f"{x} (SI)" if _numeric(rows, x) else x)
    axes.set_ylabel(label)
    if others and len(lines) <= MOST_LINES:
        axes.legend(fontsize="small")
    with written_whole(path) as temporary:
        figure.savefig(temporary, dpi=150, format="png")


def _numeric(rows: list[Row], key: str) -> bool:
    return all(isinstance(row[key], (int, float)) for row in rows)


def _spread(rows: list[Row], key: str) -> tuple[bool, int]:
    return _numeric(rows, key), len({row[key] for row in rows})
