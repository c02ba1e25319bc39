"""Figures of the energy curve: ratios, relative errors, difference against mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from imclab.agreement import Agreement, judged
from imclab.comparison import Comparison, Outcome
from imclab.report.figures.style import (
    BOUND,
    MARKERS,
    MEASURED,
    SIMULATED,
    Margins,
    new_figure,
    plain_numbers,
)
from imclab.uncertainty import coverage_factor


def energy_curve(comparison: Comparison) -> Figure:
    """Energy ratio against optical depth, and the relative error below with the bound.

    Errors that are small beside the bound are shown once more below, on their own scale.
    """
    bound = max((outcome.error.bound for outcome in comparison.outcomes), default=0.3)
    twice = 0.0 < _largest(comparison) < bound / 3
    figure, axes = new_figure(
        5.2,
        6.2 if twice else 4.8,
        3 if twice else 2,
        1,
        margins=Margins(down=0.16),
        sharex=True,
        height_ratios=(3, 2, 2)[: 3 if twice else 2],
    )
    upper = axes[0, 0]
    for index, (reference, group) in enumerate(_groups(comparison).items()):
        depth = np.array([outcome.pair.optical_depth for outcome in group])
        marker = MARKERS[index % len(MARKERS)]
        shift = 0.012 * (index - (len(_groups(comparison)) - 1) / 2)
        for which, colour, offset, fill in (
            ("measured_ratio", MEASURED, -0.003, "white"),
            ("simulated_ratio", SIMULATED, 0.003, SIMULATED),
        ):
            ratio = [getattr(outcome, which) for outcome in group]
            label = f"{which.split('_')[0]}, {reference}"
            _points(upper, depth + shift + offset, ratio, color=colour, marker=marker, mfc=fill, label=label)
        for lower in axes[1:, 0]:
            lower.errorbar(
                depth + shift,
                [100 * outcome.error.value for outcome in group],
                [100 * _half_interval(outcome) for outcome in group],
                fmt=marker,
                color=SIMULATED,
                markersize=5,
                elinewidth=1.1,
            )
    upper.set_yscale("log")
    plain_numbers(upper.yaxis)
    upper.set_ylabel("energy over that of the reference")
    upper.legend(loc="lower left")
    _mark_bound(axes[1, 0], 100 * bound)
    for lower in axes[1:, 0]:
        lower.axhline(0, color=MEASURED, linewidth=0.8)
        lower.set_ylabel("relative error / %")
    if twice:
        axes[2, 0].set_ylabel("the same, enlarged / %")
    axes[-1, 0].set_xlabel("optical depth (attenuation × distance, one way)")
    return figure


def _half_interval(outcome: Outcome) -> float:
    return coverage_factor(outcome.error.dof) * outcome.error.u_val


def _largest(comparison: Comparison) -> float:
    """Farthest end of a 95 % interval from no error."""
    return max((abs(each.error.value) + _half_interval(each) for each in judged(comparison)), default=0.0)


def _mark_bound(plot: Any, percent: float) -> None:
    for side in (-percent, percent):
        plot.axhline(side, color=BOUND, linewidth=1.0, linestyle=(0, (5, 3)))
    place = {"xycoords": ("axes fraction", "data"), "ha": "right", "va": "top", "color": BOUND}
    plot.annotate(f"±{percent:.0f} %", (1.0, 0.95 * percent), **place)


def bland_altman(comparison: Comparison, agreement: Agreement) -> Figure:
    """Difference against mean of the energy ratios, with bias and limits of agreement."""
    figure, axes = new_figure(5.2, 3.1, margins=Margins(top=0.36))
    plot, altman = axes[0, 0], agreement.bland_altman
    references = list(_groups(comparison))
    for outcome, mean, difference in zip(judged(comparison), altman.mean, altman.difference, strict=True):
        group = references.index(outcome.reference)
        marker = MARKERS[group % len(MARKERS)]
        label = f"relative to {outcome.reference}"
        plot.plot(mean, 100 * difference, marker, color=SIMULATED, markersize=5.5, label=label)
        side = 1 if group % 2 == 0 else -1
        plot.annotate(
            f"gain {outcome.pair.gain:g}",
            (mean, 100 * difference),
            (7 * side, -2.5),
            textcoords="offset points",
            ha="left" if side > 0 else "right",
            fontsize=7,
        )
    for level, name, style in (
        (altman.bias.value, "bias", "-"),
        (altman.lower, "limits of agreement", (0, (5, 3))),
        (altman.upper, "", (0, (5, 3))),
    ):
        if np.isfinite(level):
            plot.axhline(100 * level, color=BOUND, linewidth=1.0, linestyle=style)
            plot.annotate(
                name,
                (0.01, 100 * level),
                xycoords=("axes fraction", "data"),
                ha="left",
                va="bottom",
                color=BOUND,
            )
    named = dict(zip(*reversed(plot.get_legend_handles_labels()), strict=True))  # one of each group
    plot.legend(named.values(), named.keys(), loc="lower left", bbox_to_anchor=(0, 1), ncols=2)
    plot.set_xscale("log")
    plain_numbers(plot.xaxis)
    plot.margins(x=0.25, y=0.2)
    plot.set_xlabel("mean of simulated and measured energy ratio")
    plot.set_ylabel("difference over mean / %")
    return figure


def _points(axes: Any, x: NDArray[np.float64], estimates: Sequence[Any], **style: Any) -> None:
    axes.errorbar(
        x,
        [estimate.value for estimate in estimates],
        [estimate.interval[1] - estimate.value for estimate in estimates],
        linestyle="none",
        markersize=5.5,
        elinewidth=1.1,
        **style,
    )


def _groups(comparison: Comparison) -> dict[str, list[Outcome]]:
    groups: dict[str, list[Outcome]] = {}
    for outcome in comparison.outcomes:
        groups.setdefault(outcome.reference, []).append(outcome)
    return groups
