"""How figures look: colours, type, margins; drawn in black ink on white with few colours.

The page turns lightness round in dark mode, so no figure may mean anything by being light or dark.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
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


def new_figure(
    width: float, height: float, rows: int = 1, columns: int = 1, **options: Any
) -> tuple[Figure, Any]:
    """Return a figure and its axes with fixed margins, in inches.

    Matplotlib's own layouts draw every figure twice, which is half of the time of the whole report.
    """
    figure = Figure(figsize=(width, height), facecolor="white")
    left, right, bottom, top, across, down = 0.62, 0.12, 0.62, 0.26, 0.62, 0.48
    down = 0.12 if options.get("sharex") else down
    wide = (width - left - right - across * (columns - 1)) / columns
    high = (height - bottom - top - down * (rows - 1)) / rows
    margins = {
        "left": left / width,
        "right": 1 - right / width,
        "bottom": bottom / height,
        "top": 1 - top / height,
        "wspace": across / wide,
        "hspace": down / high,
    }
    return figure, figure.subplots(rows, columns, squeeze=False, gridspec_kw=margins, **options)


def panels(count: int, *, height: float) -> tuple[Figure, list[Any]]:
    """Return a figure with ``count`` panels in rows of three; unused ones are taken away."""
    columns = min(count, 3)
    rows = -(-count // columns)
    figure, axes = new_figure(3.2 * columns, height * rows, rows, columns)
    panels = list(axes.ravel())
    for spare in panels[count:]:
        spare.remove()
    return figure, panels[:count]


def drawn(figure: Figure, *, dpi: int = 180) -> NDArray[np.uint8]:
    """Return a figure as an array (rows, columns, 3)."""
    figure.set_dpi(dpi)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
