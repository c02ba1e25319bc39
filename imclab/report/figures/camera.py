"""Figure of the camera's calibration."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from imclab.report.context import Context
from imclab.report.figures.style import MEASURED, new_figure
from imclab.uncertainty import COVERAGE_95


def calibration(context: Context) -> Figure | None:
    """Response curve and gain of the camera; None when neither is given."""
    curves = [curve for curve in (context.response, context.gain) if curve is not None]
    if not curves:
        return None
    figure, axes = new_figure(7.2, 2.8, 1, len(curves))
    for plot, curve in zip(axes[0], curves, strict=True):
        plot.errorbar(
            curve.x,
            curve.y,
            COVERAGE_95 * curve.stderr,
            fmt="o-",
            color=MEASURED,
            markersize=3,
            linewidth=0.9,
        )
        plot.set_xlabel(curve.x_label)
        plot.set_ylabel(curve.y_label)
        plot.set_yscale("log")
        if np.all(curve.x > 0) and curve.x.max() > 20 * curve.x.min():
            plot.set_xscale("log")
    return figure
