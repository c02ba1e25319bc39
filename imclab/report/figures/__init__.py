"""The drawn figures of the report: `all_figures` draws them and returns PNG files."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib

from imclab.agreement import Agreement
from imclab.comparison import Comparison
from imclab.report.context import Context
from imclab.report.detail import Detail
from imclab.report.figures.camera import calibration
from imclab.report.figures.energies import bland_altman, energy_curve
from imclab.report.figures.pairs import (
    pixel_distributions,
    registration_overlays,
    sharpness,
    time_histograms,
)
from imclab.report.figures.style import ACCENT, STYLE, drawn
from imclab.report.pictures import reduced


def all_figures(
    comparison: Comparison, context: Context, *, agreement: Agreement, details: Sequence[Detail], comment: str
) -> dict[str, bytes]:
    """Draw every figure; return the PNG files by name.

    ``comment`` is written into each file, and under each figure when the data are synthetic.
    """
    with matplotlib.rc_context(STYLE):
        figures = {
            "energy": energy_curve(comparison),
            "bland-altman": bland_altman(comparison, agreement) if agreement.conditions else None,
            "time": time_histograms(comparison, context),
            "registration": registration_overlays(comparison),
            "distributions": pixel_distributions(comparison),
            "calibration": calibration(context),
        }
        for outcome, seen in zip(comparison.outcomes, details, strict=True):
            figures[f"sharpness-{outcome.pair.name}"] = sharpness(outcome, seen)
        files = {}
        for name, figure in figures.items():
            if figure is not None:
                if comparison.synthetic:
                    figure.text(0.995, 0.01, "synthetic data", fontsize=7, color=ACCENT, ha="right")
                files[name] = reduced(drawn(figure), comment=comment)
        return files
