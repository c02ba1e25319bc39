"""How figures look: colours, type, margins; drawn in black ink on white with few colours.

The page turns lightness round in dark mode, so no figure may mean anything by being light or dark.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

MEASURED, SIMULATED, BOUND, ACCENT = "#111111", "#1667a8", "#b4541a", "#7a7a7a"
MARKERS = "osD^vP"
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.edgecolor": "#444444",
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "xtick.labelcolor": "#222222",
    "ytick.labelcolor": "#222222",
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
    "errorbar.capsize": 2.5,
}


class Margins(NamedTuple):
    """Room round and between the axes of a figure, inches."""

    left: float = 0.62
    right: float = 0.12
    bottom: float = 0.62
    top: float = 0.26
    across: float = 0.62
    down: float = 0.48


def new_figure(
    width: float,
    height: float,
    rows: int = 1,
    columns: int = 1,
    *,
    margins: Margins = Margins(),  # noqa: B008  immutable
    **options: Any,
) -> tuple[Figure, Any]:
    """Return a figure of a size in inches and its axes (rows, columns), with fixed margins.

    Matplotlib's own layouts draw every figure twice, which was half of the time of the report.
    """
    figure = Figure(figsize=(width, height), facecolor="white")
    wide = (width - margins.left - margins.right - margins.across * (columns - 1)) / columns
    high = (height - margins.bottom - margins.top - margins.down * (rows - 1)) / rows
    places = {
        "left": margins.left / width,
        "right": 1 - margins.right / width,
        "bottom": margins.bottom / height,
        "top": 1 - margins.top / height,
        "wspace": margins.across / wide,
        "hspace": margins.down / high,
    }
    return figure, figure.subplots(rows, columns, squeeze=False, gridspec_kw=places, **options)


def panels(count: int, *, height: float, margins: Margins = Margins()) -> tuple[Figure, list[Any]]:  # noqa: B008
    """Return a figure with ``count`` panels in rows of three."""
    columns = min(count, 3)
    rows = -(-count // columns)
    figure, axes = new_figure(3.2 * columns, height * rows, rows, columns, margins=margins)
    every = list(axes.ravel())
    for spare in every[count:]:
        spare.remove()
    return figure, every[:count]


def drawn(figure: Figure, *, dpi: int = 180) -> NDArray[np.uint8]:
    """Return a figure as an array (rows, columns, 3)."""
    figure.set_dpi(dpi)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def plain_numbers(axis: Any) -> None:
    """Write 0.2 rather than 2 × 10⁻¹ on a logarithmic axis."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())
