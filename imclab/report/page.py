"""The report: one HTML page that needs nothing else, its numbers as JSON, its figures as PNG."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from imclab.agreement import agreement
from imclab.comparison import Comparison
from imclab.errors import OutputError
from imclab.files import written_whole
from imclab.report import pictures
from imclab.report.context import Context
from imclab.report.detail import detail
from imclab.report.figures import all_figures
from imclab.report.numbers import Document, document
from imclab.report.wording import worded

VERDICT_KINDS = {
    "agrees within its uncertainty": "good",
    "differs, inside the bound": "fair",
    "differs, perhaps outside the bound": "doubt",
    "differs, outside the bound": "bad",
    "not registered": "bad",
    "reference condition": "none",
}


@dataclass(frozen=True)
class Paths:
    """What `render` has written."""

    page: Path
    numbers: Path
    figures: tuple[Path, ...]


def render(comparison: Comparison, folder: str | Path, *, context: Context) -> Paths:
    """Write ``folder``/report.html, report.json and figures/.

    The same bytes come from the same comparison and context. Each file is written whole or not at
    all, the page last.

    Parameters
    ----------
    comparison : Comparison
    folder : path
        Must exist. Files of an earlier report are replaced.
    context : Context

    Raises
    ------
    OutputError
        When the folder may not be written to.
    """
    folder = Path(folder)
    try:
        (folder / "figures").mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror or error})") from error
    whole = agreement(comparison)
    details = [detail(outcome.pair, data_range=comparison.data_range) for outcome in comparison.outcomes]
    numbers = document(comparison, context, agreement=whole, details=details)
    comment = numbers["label"]
    shown = [
        pictures.picture_set(outcome.pair, seen.similarity, comment=comment)
        for outcome, seen in zip(comparison.outcomes, details, strict=True)
    ]
    drawn = all_figures(comparison, context, agreement=whole, details=details, comment=comment)
    files = {file_name(name): data for name, data in drawn.items()}
    for outcome, views in zip(comparison.outcomes, shown, strict=True):
        files |= {file_name(f"{outcome.pair.name}-{view}"): data for view, data in views.items()}
    html = _page(numbers, shown, drawn)
    for name, data in files.items():
        with written_whole(folder / "figures" / name) as temporary:
            temporary.write_bytes(data)
    with written_whole(folder / "report.json") as temporary:
        text = json.dumps(numbers, indent=1, ensure_ascii=False, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    with written_whole(folder / "report.html") as temporary:
        temporary.write_text(html, encoding="utf-8")
    return Paths(
        folder / "report.html", folder / "report.json", tuple(folder / "figures" / name for name in files)
    )


def file_name(name: str) -> str:
    """Return the file name of a figure; what a file system may not like becomes a dash."""
    return re.sub(r"[^\w .+-]", "-", name) + ".png"


def at(numbers: Document, pointer: str) -> Any:
    """Return what a JSON pointer (RFC 6901) names."""
    found: Any = numbers
    for part in pointer.split("/")[1:]:
        key = part.replace("~1", "/").replace("~0", "~")
        found = found[int(key)] if isinstance(found, list) else found[key]
    return found


def _page(numbers: Document, shown: list[dict[str, bytes]], drawn: Mapping[str, bytes]) -> str:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("imclab.report", "template"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )

    def number(pointer: str, style: str = "plain") -> Markup:
        """Write the number at ``pointer`` of report.json, which the element names."""
        found = at(numbers, pointer)
        value = "" if found["value"] is None else json.dumps(found["value"])
        return Markup('<data value="{}" data-json="{}" data-style="{}">{}</data>').format(
            value, pointer, style, worded(found, style)
        )

    environment.globals.update(
        number=number,
        key=lambda text: text.replace("~", "~0").replace("/", "~1"),
        kind=VERDICT_KINDS.__getitem__,
        size=_size,
        glyph=_glyph,
        data_uri=lambda data: f"data:image/png;base64,{base64.b64encode(data).decode('ascii')}",
        gradients={
            "energy": pictures.gradient(pictures.ENERGY.colours),
            "difference": pictures.gradient(pictures.DIFFERENCE.colours),
            "z": pictures.gradient(pictures.Z_SCORE.colours),
            "similarity": pictures.gradient(pictures.SIMILARITY.colours),
        },
        z_limit=f"{pictures.Z_LIMIT:g}",
        difference_limit=f"{100 * pictures.DIFFERENCE_SHARE:g}",
    )
    page = environment.get_template("page.html")
    return page.render(report=numbers, shown=shown, drawn=drawn)


def _size(png: bytes, scale: float) -> Markup:
    """Width and height of a PNG as attributes, so that the page does not jump while it loads."""
    width, height = (int.from_bytes(png[start : start + 4], "big") for start in (16, 20))
    return Markup('width="{}" height="{}"').format(round(width * scale), round(height * scale))


def _glyph(condition: Document) -> Markup:
    """Draw an error with its 95 % interval between -45 and +45 % and the bound; for the eye alone."""
    error, bound = condition["error"], condition["bound"]["value"]

    def place(value: float) -> str:
        return f"{55 + 52 * min(max(value / 0.45, -1.0), 1.0):.1f}"

    low, high = (place(end) for end in error["interval_95"])
    return Markup(
        '<svg class="glyph" viewBox="0 0 110 16" aria-hidden="true">'
        '<line class="axis" x1="55" x2="55" y1="1" y2="15"/>'
        '<line class="bound" x1="{left}" x2="{left}" y1="1" y2="15"/>'
        '<line class="bound" x1="{right}" x2="{right}" y1="1" y2="15"/>'
        '<line class="range" x1="{low}" x2="{high}" y1="8" y2="8"/><circle cx="{middle}" cy="8" r="3"/></svg>'
    ).format(left=place(-bound), right=place(bound), low=low, high=high, middle=place(error["value"]))
