"""Figure of the camera's calibration."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from imclab.report.context import Context
from imclab.report.figures.style import MEASURED, new_figure, plain_numbers
from imclab.uncertainty import COVERAGE_95

_FEW = 20
"""Points that are marked one by one; more are a curve."""


def calibration(context: Context) -> Figure | None:
    """Response curve and gain of the camera; None when neither is given."""
    curves = [curve for curve in (context.response, context.gain) if curve is not None]
    if not curves:
        return None
    figure, axes = new_figure(7.2, 2.8, 1, len(curves))
    for plot, curve in zip(axes[0], curves, strict=True):
        half = COVERAGE_95 * curve.stderr
        plot.fill_between(curve.x, curve.y - half, curve.y + half, color=MEASURED, alpha=0.25, linewidth=0)
        marker = "o" if curve.x.size <= _FEW else ""
        plot.plot(curve.x, curve.y, marker=marker, color=MEASURED, markersize=3, linewidth=1.1)
        plot.set_xlabel(curve.x_label)
        plot.set_ylabel(curve.y_label)
        plot.set_yscale("log")
        plain_numbers(plot.yaxis)
        if np.all(curve.x > 0) and curve.x.max() > 20 * curve.x.min():
            plot.set_xscale("log")
    return figure
