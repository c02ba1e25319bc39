"""What a study says: a table, a figure, and statements that are true or not, with their numbers."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from imclab.files import written_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = dict[str, Any]


@dataclass(frozen=True)
class Statement:
    """A sentence of the paper, whether our numbers bear it out, and the numbers."""

    text: str
    true: bool
    numbers: str


@dataclass(frozen=True, kw_only=True)
class Conclusion:
    """A finished study.

    Attributes
    ----------
    title, shows : str
        What the study is called, and what of the paper it makes again.
    rows : sequence of mapping
        The table, ours beside the paper's; all rows have the same columns.
    statements : sequence of Statement
    largest_relative_error : float
        Largest standard error of any plotted point, over the point itself or its curve's largest.
    cpu_seconds : float
        Of all units, whenever they were run.
    figure : matplotlib Figure
    """

    title: str
    shows: str
    rows: Sequence[Row]
    statements: Sequence[Statement]
    largest_relative_error: float
    cpu_seconds: float
    figure: Figure

    def save(self, folder: Path) -> None:
        """Write ``figure.png``, ``results.csv``, ``study.json`` and ``study.md`` into the folder."""
        with written_whole(folder / "figure.png") as temporary:
            self.figure.savefig(temporary, dpi=150, format="png")
        with written_whole(folder / "results.csv") as temporary, temporary.open("w", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=list(self.rows[0]))
            writer.writeheader()
            writer.writerows(self.rows)
        with written_whole(folder / "study.json") as temporary:
            temporary.write_text(json.dumps(self.summary(), indent=2) + "\n", encoding="utf-8")
        with written_whole(folder / "study.md") as temporary:
            temporary.write_text(self.markdown(), encoding="utf-8")

    def summary(self) -> dict[str, Any]:
        """Return everything but the figure, as JSON can hold it."""
        return {
            "title": self.title,
            "shows": self.shows,
            "statements": [asdict(statement) for statement in self.statements],
            "largest_relative_error": self.largest_relative_error,
            "cpu_seconds": self.cpu_seconds,
            "rows": list(self.rows),
        }

    def markdown(self) -> str:
        """Return the study as a page: statements first, then the table."""
        columns = list(self.rows[0])
        lines = [f"# {self.shows}: {self.title}", "", "![figure](figure.png)", ""]
        lines += [f"- **{'True' if s.true else 'Not true'}**: {s.text} {s.numbers}" for s in self.statements]
        lines += ["", "| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
        lines += ["| " + " | ".join(_shown(row[name]) for name in columns) + " |" for row in self.rows]
        return "\n".join(lines) + "\n"


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
