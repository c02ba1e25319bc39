"""How beam and pulse spread one way through water (Fig. 2), and the paper's three findings about it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

from imclab.result import Flux, Result
from imclab.study.conclusion import Conclusion, Row, Statement
from imclab.study.file import Study
from imclab.study.ratios import difference, ratio, shown
from imclab.uncertainty import Estimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINE_WIDTH = 0.01
"""Curves nearer to one another than this share of their height are one line in a figure.

It is the width that the standard errors of every study have to stay below, set before anything was run.
The paper gives its "extremely weak" and "almost unaffected" no number.
"""
SIGMAS = 3.0
"""Two numbers differ for sure when they are so many standard errors apart."""
_COLUMNS = ("transmitted", "spot_fwhm", "spot_rms", "pulse_fwhm", "pulse_rms")
_PLOTTED = ("spot_fwhm", "pulse_fwhm")

Beam = tuple[float, float]
"""Divergence (rad) and spot (m), both full widths at half maximum."""


def conclude(study: Study, records: Sequence[Result | Flux]) -> Conclusion:
    """Return table, figure and statements of a study of one-way runs, one per beam."""
    lasers = [unit.scene.laser for unit in study.units]
    beams = {
        (laser.divergence_fwhm, laser.spot_fwhm): cast(Flux, record)
        for laser, record in zip(lasers, records, strict=True)
    }
    return Conclusion(
        title=study.title,
        shows=study.shows,
        rows=[row for beam, flux in beams.items() for row in _rows(beam, flux)],
        statements=[
            *(_radius_statement(beams, quantity) for quantity in ("spot_rms", "spot_fwhm")),
            *(_divergence_statement(beams, quantity) for quantity in ("spot_rms", "spot_fwhm")),
            *_pulse_statements(beams),
        ],
        largest_relative_error=max(
            float((getattr(flux, f"{name}_stderr") / getattr(flux, name)).max())
            for flux in beams.values()
            for name in _PLOTTED
        ),
        cpu_seconds=sum(record.cpu_seconds for record in records),
        figure=_figure(beams),
    )


def _rows(beam: Beam, flux: Flux) -> list[Row]:
    head = {"divergence_mrad": 1e3 * beam[0], "spot_mm": 1e3 * beam[1]}
    return [
        head
        | {"distance_m": float(distance)}
        | {
            name: float(getattr(flux, name)[plane])
            for column in _COLUMNS
            for name in (column, f"{column}_stderr")
        }
        for plane, distance in enumerate(flux.distances)
    ]


def _at(flux: Flux, quantity: str, plane: int) -> Estimate:
    return Estimate(float(getattr(flux, quantity)[plane]), float(getattr(flux, f"{quantity}_stderr")[plane]))


def _apart(beams: Sequence[Flux], quantity: str, plane: int) -> Estimate:
    """Relative difference between the widest and the narrowest of some beams at one plane."""
    widths = sorted((_at(flux, quantity, plane) for flux in beams), key=lambda width: width.value)
    over = ratio(widths[-1], widths[0])
    return Estimate(over.value - 1.0, over.stderr)


def _surely_apart(apart: Estimate) -> bool:
    return apart.value - LINE_WIDTH > SIGMAS * apart.stderr


def _radius_statement(beams: dict[Beam, Flux], quantity: str) -> Statement:
    divergences = sorted({divergence for divergence, _ in beams})
    distances = next(iter(beams.values())).distances
    apart = {
        (divergence, plane): _apart(
            [flux for beam, flux in beams.items() if beam[0] == divergence], quantity, plane
        )
        for divergence in divergences
        for plane in range(len(distances))
    }
    (divergence, plane), worst = max(apart.items(), key=lambda item: item[1].value)
    large = sorted({float(distances[p]) for (_, p), value in apart.items() if _surely_apart(value)})
    numbers = (
        f"The spots of one divergence differ most by {shown(worst, percent=True)}, at "
        f"{1e3 * divergence:.0f} mrad and {distances[plane]:g} m"
    )
    if large:
        planes = ", ".join(f"{distance:g}" for distance in large)
        numbers += (
            f"; for sure by more than the width of a line ({100 * LINE_WIDTH:.0f} %) at {planes} m only"
        )
    return Statement(
        f"The initial radius does not matter at one divergence ({quantity}).", not large, f"{numbers}."
    )


def _divergence_statement(beams: dict[Beam, Flux], quantity: str) -> Statement:
    spot = min(spot for _, spot in beams)
    divergences = sorted(divergence for divergence, other in beams if other == spot)
    narrow, wider, widest = divergences[0], divergences[1], divergences[-1]
    distances = beams[narrow, spot].distances

    def at(divergence: float, plane: int) -> Estimate:
        return ratio(_at(beams[divergence, spot], quantity, plane), _at(beams[narrow, spot], quantity, plane))

    near, far, near_wider, far_wider = at(widest, 0), at(widest, -1), at(wider, 0), at(wider, -1)
    falls = _exceeds(near, far)
    apart = Estimate(far_wider.value - 1.0, far_wider.stderr)
    alike = _exceeds(near_wider, far_wider) or not _surely_apart(apart)
    distinct = _exceeds(far, far_wider)
    text = (
        "The divergence matters at short range and less at long: the narrow beams become alike, the "
        f"widest stays apart ({quantity})."
    )
    numbers = (
        f"{1e3 * widest:.0f} over {1e3 * narrow:.0f} mrad: {shown(near)} at {distances[0]:g} m, "
        f"{shown(far)} at {distances[-1]:g} m; {1e3 * wider:.0f} over {1e3 * narrow:.0f} mrad: "
        f"{shown(near_wider)} and {shown(far_wider)}."
    )
    return Statement(text, falls and alike and distinct, numbers)


def _exceeds(larger: Estimate, smaller: Estimate) -> bool:
    gap = difference(larger, smaller)
    return gap.value > SIGMAS * gap.stderr


def _pulse_statements(beams: dict[Beam, Flux]) -> list[Statement]:
    """Two readings of "almost unaffected": less than the beam's width is, and not to be seen at all."""
    distances = next(iter(beams.values())).distances
    planes = range(len(distances))
    fluxes = list(beams.values())
    pulse = [_apart(fluxes, "pulse_fwhm", plane) for plane in planes]
    spot = [_apart(fluxes, "spot_fwhm", plane) for plane in planes]
    nearest = min(planes, key=lambda plane: spot[plane].value / max(pulse[plane].value, LINE_WIDTH))
    less = Statement(
        "Divergence and initial radius affect the pulse's width less than the beam's, at every distance.",
        all(_exceeds(spot[plane], pulse[plane]) for plane in planes),
        f"They come nearest at {distances[nearest]:g} m: all beams differ by "
        f"{shown(pulse[nearest], percent=True)} in time, by {shown(spot[nearest], percent=True)} in space.",
    )
    worst = max(planes, key=lambda plane: pulse[plane].value)
    large = [float(distances[plane]) for plane in planes if _surely_apart(pulse[plane])]
    first, last = _at(fluxes[0], "pulse_fwhm", 0), _at(fluxes[0], "pulse_fwhm", -1)
    seen = f"; for sure by more than the width of a line ({100 * LINE_WIDTH:.0f} %) from {{:g}} m on"
    unseen = Statement(
        "Their effect on the pulse's width is too small to be seen in a figure.",
        not large,
        f"All beams differ by at most {shown(pulse[worst], percent=True)}, at {distances[worst]:g} m"
        f"{seen.format(min(large)) if large else ''}; "
        f"the pulse grows from {1e9 * first.value:.3f} ns at {distances[0]:g} m "
        f"to {1e9 * last.value:.2f} ns at {distances[-1]:g} m.",
    )
    return [less, unseen]


def _figure(beams: dict[Beam, Flux]) -> Figure:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(10, 4.6), layout="constrained")
    space, pulse = figure.subplots(1, 2)
    styles = dict(zip(sorted({spot for _, spot in beams}), ("-", "--", ":"), strict=False))
    colours = {d: f"C{number}" for number, d in enumerate(sorted({d for d, _ in beams}))}
    for (divergence, spot), flux in beams.items():
        look = {"color": colours[divergence], "linestyle": styles.get(spot, "-."), "linewidth": 1.3}
        space.errorbar(flux.distances, 1e3 * flux.spot_fwhm, 1e3 * flux.spot_fwhm_stderr, **look)
        pulse.errorbar(flux.distances, 1e9 * flux.pulse_fwhm, 1e9 * flux.pulse_fwhm_stderr, **look)
    space.set(
        xlabel="distance (m)",
        ylabel="beam, full width at half maximum (mm)",
        xscale="log",
        yscale="log",
        title="in space",
    )
    ticks = [1, 2, 5, 10, 20, 30]
    space.set_xticks(ticks, [f"{tick}" for tick in ticks], minor=False)
    space.set_xticks([], minor=True)
    pulse.set(xlabel="distance (m)", ylabel="pulse, full width at half maximum (ns)", title="in time")
    lines = [Line2D([], [], color=colour) for colour in colours.values()]
    names = [f"divergence {1e3 * divergence:.0f} mrad" for divergence in colours]
    lines += [Line2D([], [], color="0.3", linestyle=style) for style in styles.values()]
    names += [f"initial spot {1e3 * spot:g} mm" for spot in styles]
    pulse.legend(lines, names, fontsize="small", title="error bars: one standard error")
    return figure
