"""Figures of each pair of pictures: profiles and edges, times, places, distributions."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

from imclab.comparison import Comparison, Outcome
from imclab.registration import Registration
from imclab.registration.motion import displacements, moved
from imclab.report.context import Context
from imclab.report.detail import Detail
from imclab.report.figures.style import ACCENT, BOUND, MEASURED, SIMULATED, Margins, new_figure, panels
from imclab.report.pictures import brightest
from imclab.uncertainty import COVERAGE_95

_DARK = "#1b2025"  # behind photographs, which the page does not turn to the dark
_CHI_SQUARE_95 = 5.991  # of two degrees of freedom


def sharpness(outcome: Outcome, seen: Detail) -> Figure:
    """Profiles across and down the target, and the response of a slanted edge."""
    figure, axes = new_figure(9.6, 2.7, 1, 3)
    top = brightest(outcome.pair)
    for plot, both, name in (
        (axes[0, 0], seen.across, "across: mean of 9 rows"),
        (axes[0, 1], seen.down, "down: mean of 9 columns"),
    ):
        for one, colour, label in (
            (both.measured, MEASURED, "measured"),
            (both.simulated, SIMULATED, "simulated"),
        ):
            low, high = (one.mean + sign * COVERAGE_95 * one.stderr for sign in (-1, 1))
            plot.fill_between(one.position, low / top, high / top, color=colour, alpha=0.2, linewidth=0)
            plot.plot(one.position, one.mean / top, color=colour, label=label, linewidth=1.1)
        plot.set_title(name)
        plot.set_xlabel("camera pixel")
    axes[0, 0].set_ylabel("energy per pixel / white")
    plot = axes[0, 2]
    plot.set_title("slanted edge")
    if seen.edge is None:
        plot.text(
            0.5, 0.5, "no straight slanted edge found", ha="center", va="center", transform=plot.transAxes
        )
    else:
        for edge, colour in zip(seen.edge, (MEASURED, SIMULATED), strict=True):
            low, high = (edge.mtf + sign * COVERAGE_95 * edge.mtf_stderr for sign in (-1, 1))
            plot.fill_between(edge.frequency, low, high, color=colour, alpha=0.2, linewidth=0)
            plot.plot(edge.frequency, edge.mtf, color=colour)
        plot.axhline(0.5, color=ACCENT, linewidth=0.7, linestyle=":")
    plot.set_xlim(0, 0.5)
    plot.set_ylim(0, 1.1)
    plot.set_xlabel("cycles per pixel")
    plot.set_ylabel("modulation transfer")
    # Here the curves fall, and leave room.
    plot.legend(*axes[0, 0].get_legend_handles_labels(), loc="upper right")
    return figure


def time_histograms(comparison: Comparison, context: Context) -> Figure | None:
    """Light against time before the gate acts, with the gate; None when no result has times."""
    timed = [outcome for outcome in comparison.outcomes if outcome.pair.result.time_energy is not None]
    if not timed:
        return None
    figure, axes = panels(len(timed), height=2.1)
    for plot, outcome in zip(axes, timed, strict=False):
        result = outcome.pair.result
        energy = np.asarray(result.time_energy)
        share = energy / max(float(energy.max()), np.finfo(float).tiny)
        plot.stairs(share, np.asarray(result.time_edges) * 1e9, color=SIMULATED, fill=True, alpha=0.75)
        gate = context.gates.get(outcome.pair.name)
        if gate is not None:
            plot.axvspan(gate[0] * 1e9, gate[1] * 1e9, color=BOUND, alpha=0.18, linewidth=0)
            for side in gate:
                plot.axvline(side * 1e9, color=BOUND, linewidth=1.0)
        plot.set_title(outcome.pair.name)
        plot.set_ylim(0, 1.08)
        plot.set_ylabel("power / highest")
        _show_light(plot, np.asarray(result.time_edges) * 1e9, share, gate)
    for plot in axes[-3:]:
        plot.set_xlabel("time / ns")
    return figure


def _show_light(plot: Any, edges: NDArray[np.float64], share: NDArray[np.float64], gate: Any) -> None:
    """Limit the time axis to where there is light or a gate."""
    lit = np.flatnonzero(share > 1e-3)
    if lit.size == 0:
        return
    first, last = edges[lit[0]], edges[lit[-1] + 1]
    if gate is not None:
        first, last = min(first, gate[0] * 1e9), max(last, gate[1] * 1e9)
    margin = 0.05 * (last - first)
    plot.set_xlim(first - margin, last + margin)


def registration_overlays(comparison: Comparison) -> Figure:
    """Outline of the simulated figure on each measured frame, with error ellipses at its corners."""
    magnified = _magnification(comparison)
    margins = Margins(left=0.1, right=0.1, bottom=0.3, across=0.1, down=0.3)
    figure, axes = panels(len(comparison.outcomes), height=3.2, margins=margins)
    figure.set_facecolor(_DARK)
    told = f"ellipses: 95 % regions, {magnified:g} times magnified"
    figure.text(0.01, 0.01, told, color="white", fontsize=7.5)
    for plot, outcome in zip(axes, comparison.outcomes, strict=False):
        pair = outcome.pair
        top = brightest(pair)
        plot.set_facecolor("#4a6282")
        plot.imshow(
            np.ma.masked_invalid(pair.measured / top), cmap="gray", vmin=0, vmax=1.15, interpolation="nearest"
        )
        low, high = np.nanquantile(pair.simulated[pair.region], [0.1, 0.97])
        if high > low:
            plot.contour(pair.simulated, levels=[(low + high) / 2], colors=["#ff7f2a"], linewidths=0.8)
        if np.isfinite(pair.registration.matrix).all():
            _frame_with_ellipses(plot, pair.registration, magnified)
        title = pair.name if pair.registration.ok else f"{pair.name}: not registered"
        plot.set_title(title, color="white")
        plot.grid(visible=False)
        plot.set_xticks([])
        plot.set_yticks([])
        plot.set_xlim(-0.5, pair.measured.shape[1] - 0.5)
        plot.set_ylim(pair.measured.shape[0] - 0.5, -0.5)
    return figure


def _magnification(comparison: Comparison) -> float:
    """Round number that makes the largest ellipse about a twelfth of a frame."""
    sizes = [
        float(np.max(outcome.pair.registration.corner_stderr_px)) / outcome.pair.measured.shape[1]
        for outcome in comparison.outcomes
        if np.isfinite(outcome.pair.registration.corner_stderr_px).all()
    ]
    largest = max(sizes, default=0.0)
    offered = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
    return next((times for times in offered if times * largest > 0.02), offered[-1])


def _frame_with_ellipses(plot: Any, found: Registration, magnified: float) -> None:
    """Draw the border of the simulated picture where it lies, and the 95 % region of each corner."""
    rows, columns = found.fixed_shape
    corners = np.array([[0, 0], [columns - 1, 0], [columns - 1, rows - 1], [0, rows - 1]], dtype=float)
    placed = moved(found.matrix, corners)
    plot.plot(*placed[[0, 1, 2, 3, 0]].T, color="#39a0ff", linewidth=0.8)
    slopes = displacements(found.matrix, corners, found.frame, len(found.covariance))
    for corner, slope in zip(placed, slopes, strict=True):
        values, vectors = np.linalg.eigh(slope @ found.covariance @ slope.T)
        small, large = 2 * magnified * np.sqrt(_CHI_SQUARE_95 * np.maximum(values, 0.0))
        angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
        plot.add_patch(
            Ellipse(tuple(corner), large, small, angle=angle, fill=False, color="#39a0ff", linewidth=0.9)
        )


def pixel_distributions(comparison: Comparison) -> Figure:
    """Cumulative distributions of the pixels' energies; the shaded area is the area metric."""
    figure, axes = panels(len(comparison.outcomes), height=2.1)
    share = np.linspace(0.0, 1.0, 401)
    for plot, outcome in zip(axes, comparison.outcomes, strict=False):
        pair = outcome.pair
        top = brightest(pair)
        measured, simulated = (
            np.quantile(picture[pair.region], share) / top for picture in (pair.measured, pair.simulated)
        )
        plot.fill_betweenx(share, measured, simulated, color=BOUND, alpha=0.35, linewidth=0)
        plot.plot(measured, share, color=MEASURED, label="measured", linewidth=1.1)
        plot.plot(simulated, share, color=SIMULATED, label="simulated", linewidth=1.1)
        plot.set_title(pair.name)
        plot.set_xlim(-0.1, 1.15)
    axes[0].legend(loc="lower right")
    for plot in axes[-3:]:
        plot.set_xlabel("energy per pixel / white")
    return figure
