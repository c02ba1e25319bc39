"""The drawn figures of the report: each function takes what it shows and returns a figure.

Drawn in black ink on white with few colours; the page turns lightness round in dark mode, so no
figure may mean anything by being light or dark.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

from imclab.agreement import Agreement, judged
from imclab.comparison import Comparison, Outcome
from imclab.registration import Registration
from imclab.registration.motion import displacements, moved
from imclab.report.context import Context
from imclab.report.detail import Detail
from imclab.report.pictures import brightest, reduced
from imclab.uncertainty import COVERAGE_95

MEASURED, SIMULATED, BOUND, ACCENT = "#111111", "#1667a8", "#b4541a", "#7a7a7a"
_MARKERS = "osD^vP"
_CHI_SQUARE_95 = 5.991  # of two degrees of freedom
_STYLE: dict[Any, Any] = {
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


def all_figures(
    comparison: Comparison, context: Context, *, agreement: Agreement, details: Sequence[Detail], comment: str
) -> dict[str, bytes]:
    """Draw every figure; return the PNG files by name.

    ``comment`` is written into each file, and under each figure when the data are synthetic.
    """
    with matplotlib.rc_context(_STYLE):
        figures = {
            "energy": energy_curve(comparison),
            "bland-altman": bland_altman(comparison, agreement) if agreement.conditions else None,
            "time": time_histograms(comparison, context),
            "registration": registration_overlays(comparison),
            "distributions": pixel_distributions(comparison),
            "calibration": calibration(context),
        }
        for outcome, seen in zip(comparison.outcomes, details, strict=True):
            figures[f"sharpness {outcome.pair.name}"] = sharpness(outcome, seen)
        files = {}
        for name, figure in figures.items():
            if figure is not None:
                if comparison.synthetic:
                    figure.text(0.995, 0.01, "synthetic data", fontsize=7, color=ACCENT, ha="right")
                files[name] = reduced(_drawn(figure), comment=comment)
        return files


def _drawn(figure: Figure, *, dpi: int = 180) -> NDArray[np.uint8]:
    """Return a figure as an array (rows, columns, 3)."""
    figure.set_dpi(dpi)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _figure(
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


def energy_curve(comparison: Comparison) -> Figure:
    """Energy ratio against optical depth, and the relative error below with the bound."""
    figure, axes = _figure(5.2, 4.8, 2, 1, sharex=True, height_ratios=(3, 2))
    upper, lower = axes[:, 0]
    for index, (reference, group) in enumerate(_groups(comparison).items()):
        depth = np.array([outcome.pair.optical_depth for outcome in group])
        marker = _MARKERS[index % len(_MARKERS)]
        shift = 0.012 * (index - (len(_groups(comparison)) - 1) / 2)
        for which, colour, offset, fill in (
            ("measured_ratio", MEASURED, -0.003, "white"),
            ("simulated_ratio", SIMULATED, 0.003, SIMULATED),
        ):
            ratio = [getattr(outcome, which) for outcome in group]
            label = f"{which.split('_')[0]}, {reference}"
            _points(upper, depth + shift + offset, ratio, color=colour, marker=marker, mfc=fill, label=label)
        lower.errorbar(
            depth + shift,
            [100 * outcome.error.value for outcome in group],
            [100 * COVERAGE_95 * outcome.error.u_val for outcome in group],
            fmt=marker,
            color=SIMULATED,
            markersize=5,
            elinewidth=1.1,
            label=f"relative to {reference}",
        )
    upper.set_yscale("log")
    _plain_numbers(upper.yaxis)
    upper.set_ylabel("energy over that of the reference")
    upper.legend(loc="lower left")
    bound = 100 * max((outcome.error.bound for outcome in comparison.outcomes), default=0.3)
    lower.axhline(0, color=MEASURED, linewidth=0.8)
    for side in (-bound, bound):
        lower.axhline(side, color=BOUND, linewidth=1.0, linestyle=(0, (5, 3)))
    lower.annotate(
        f"±{bound:.0f} %",
        (1.0, bound),
        xycoords=("axes fraction", "data"),
        ha="right",
        va="bottom",
        color=BOUND,
    )
    lower.set_ylabel("simulated/measured − 1 / %")
    lower.set_xlabel("optical depth (attenuation × distance, one way)")
    return figure


def _plain_numbers(axis: Any) -> None:
    """Write 0.2 rather than 2 × 10⁻¹ on a logarithmic axis."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def _points(axes: Any, x: NDArray[np.float64], estimates: Sequence[Any], **style: Any) -> None:
    axes.errorbar(
        x,
        [estimate.value for estimate in estimates],
        [COVERAGE_95 * estimate.stderr for estimate in estimates],
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


def bland_altman(comparison: Comparison, agreement: Agreement) -> Figure:
    """Difference against mean of the energy ratios, with bias and limits of agreement."""
    figure, axes = _figure(5.2, 3.0)
    plot, altman = axes[0, 0], agreement.bland_altman
    references = list(_groups(comparison))
    for outcome, mean, difference in zip(judged(comparison), altman.mean, altman.difference, strict=True):
        group = references.index(outcome.reference)
        marker = _MARKERS[group % len(_MARKERS)]
        plot.plot(mean, 100 * difference, marker, color=SIMULATED, markersize=5.5)
        place = (6, 4 if group % 2 == 0 else -11)
        text = f"gain {outcome.pair.gain:g}"
        plot.annotate(text, (mean, 100 * difference), place, textcoords="offset points", fontsize=7)
    for level, name, style in (
        (altman.bias.value, "bias", "-"),
        (altman.lower, "limits of agreement", (0, (5, 3))),
        (altman.upper, "", (0, (5, 3))),
    ):
        if np.isfinite(level):
            plot.axhline(100 * level, color=BOUND, linewidth=1.0, linestyle=style)
            plot.annotate(
                name,
                (1.0, 100 * level),
                xycoords=("axes fraction", "data"),
                ha="right",
                va="bottom",
                color=BOUND,
            )
    plot.set_xscale("log")
    _plain_numbers(plot.xaxis)
    plot.margins(x=0.25, y=0.2)
    plot.set_xlabel("mean of simulated and measured energy ratio")
    plot.set_ylabel("difference over mean / %")
    return figure


def sharpness(outcome: Outcome, seen: Detail) -> Figure:
    """Profiles across and down the target, and the response of a slanted edge."""
    figure, axes = _figure(9.6, 2.7, 1, 3)
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
    axes[0, 0].legend(loc="upper right")
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
    return figure


def time_histograms(comparison: Comparison, context: Context) -> Figure | None:
    """Light against time before the gate acts, with the gate; None when no result has times."""
    timed = [outcome for outcome in comparison.outcomes if outcome.pair.result.time_energy is not None]
    if not timed:
        return None
    figure, axes = _panels(len(timed), height=2.1)
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


def registration_overlays(comparison: Comparison, *, magnified: float = 50.0) -> Figure:
    """Outline of the simulated figure on each measured frame, with error ellipses at its corners."""
    figure, axes = _panels(len(comparison.outcomes), height=2.9)
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
        plot.set_title(pair.name if pair.registration.ok else f"{pair.name}: not registered")
        plot.grid(visible=False)
        plot.set_xticks([])
        plot.set_yticks([])
        plot.set_xlim(-0.5, pair.measured.shape[1] - 0.5)
        plot.set_ylim(pair.measured.shape[0] - 0.5, -0.5)
    return figure


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
    figure, axes = _panels(len(comparison.outcomes), height=2.1)
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


def calibration(context: Context) -> Figure | None:
    """Response curve and gain of the camera; None when neither is given."""
    curves = [curve for curve in (context.response, context.gain) if curve is not None]
    if not curves:
        return None
    figure, axes = _figure(7.2, 2.8, 1, len(curves))
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


def _panels(count: int, *, height: float) -> tuple[Figure, list[Any]]:
    """Return a figure with ``count`` panels in rows of three; unused ones are taken away."""
    columns = min(count, 3)
    rows = -(-count // columns)
    figure, axes = _figure(3.2 * columns, height * rows, rows, columns)
    panels = list(axes.ravel())
    for spare in panels[count:]:
        spare.remove()
    return figure, panels[:count]
