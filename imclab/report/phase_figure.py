"""The plot of phase functions against angle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from imclab.optics.phase import PhaseFunction


def phase_figure(phase_functions: Mapping[str, PhaseFunction]) -> Figure:
    """Phase functions against angle: all angles on the left, the forward peak on log-log paper."""
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    wide, peak = figure.subplots(1, 2, width_ratios=[1.4, 1.0], sharey=True)
    degrees, small = np.linspace(0.1, 180.0, 1800), np.geomspace(0.01, 10.0, 400)
    for number, (name, phase_function) in enumerate(phase_functions.items()):
        style = {"lw": 1.1, "color": f"C{number}", "ls": ("-", "--", "-.", ":")[number % 4]}
        wide.semilogy(degrees, phase_function.evaluate(np.cos(np.radians(degrees))), label=name, **style)
        peak.loglog(small, phase_function.density(2.0 * np.sin(np.radians(small) / 2.0) ** 2), **style)
    wide.set_xlabel("scattering angle / deg")
    wide.set_ylabel("phase function / (1/sr)")
    wide.set_xlim(0.0, 180.0)
    wide.set_xticks(range(0, 181, 30))
    wide.legend(fontsize=8)
    peak.set_xlabel("scattering angle / deg")
    for axes in (wide, peak):
        axes.grid(visible=True, alpha=0.3)
    return figure
