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

# What the statements call "no difference": 5 % of a width cannot be read off the paper's figure.
SMALL = 0.05
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
            _pulse_statement(beams),
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


def _surely_large(apart: Estimate) -> bool:
    return apart.value - 2 * apart.stderr > SMALL


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
    large = [distances[p] for (_, p), value in apart.items() if _surely_large(value)]
    numbers = (
        f"The spots of one divergence differ most by {shown(worst, percent=True)}, at "
        f"{1e3 * divergence:.0f} mrad and {distances[plane]:g} m"
    )
    if large:
        numbers += f"; nowhere beyond {max(large):g} m by more than {100 * SMALL:.0f} % for sure"
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

    near, far, far_wider = at(widest, 0), at(widest, -1), at(wider, -1)
    falls = near.value - far.value > 3 * difference(near, far).stderr
    merged = abs(far_wider.value - 1) < SMALL
    distinct = far.value - 1 > 3 * far.stderr
    text = (
        "The divergence matters at short range and less at long: the narrow beams become alike, the "
        f"widest stays apart ({quantity})."
    )
    numbers = (
        f"{1e3 * widest:.0f} over {1e3 * narrow:.0f} mrad: {shown(near)} at {distances[0]:g} m, "
        f"{shown(far)} at {distances[-1]:g} m; {1e3 * wider:.0f} over {1e3 * narrow:.0f} mrad: "
        f"{shown(at(wider, 0))} and {shown(far_wider)}."
    )
    return Statement(text, falls and merged and distinct, numbers)


def _pulse_statement(beams: dict[Beam, Flux]) -> Statement:
    distances = next(iter(beams.values())).distances
    fluxes = list(beams.values())
    apart = [_apart(fluxes, "pulse_fwhm", plane) for plane in range(len(distances))]
    plane = max(range(len(distances)), key=lambda p: apart[p].value)
    large = [float(distances[p]) for p in range(len(distances)) if _surely_large(apart[p])]
    first, last = _at(fluxes[0], "pulse_fwhm", 0), _at(fluxes[0], "pulse_fwhm", -1)
    numbers = (
        f"All beams differ by at most {shown(apart[plane], percent=True)}, at {distances[plane]:g} m"
        f"{f', and by more than {100 * SMALL:.0f} % only from {min(large):g} m on' if large else ''}; "
        f"the pulse grows from {1e9 * first.value:.4f} ns at {distances[0]:g} m "
        f"to {1e9 * last.value:.2f} ns at {distances[-1]:g} m."
    )
    text = "Temporal broadening hardly depends on divergence or initial radius."
    return Statement(text, not large, numbers)


def _figure(beams: dict[Beam, Flux]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.2), layout="constrained")
    space, pulse = figure.subplots(1, 2)
    styles = dict(zip(sorted({spot for _, spot in beams}), ("-", "--", ":"), strict=False))
    colours = {d: f"C{number}" for number, d in enumerate(sorted({d for d, _ in beams}))}
    for (divergence, spot), flux in beams.items():
        look = {"color": colours[divergence], "linestyle": styles.get(spot, "-.")}
        label = f"{1e3 * divergence:.0f} mrad, {1e3 * spot:g} mm"
        space.errorbar(flux.distances, 1e3 * flux.spot_fwhm, 1e3 * flux.spot_fwhm_stderr, label=label, **look)
        pulse.errorbar(flux.distances, 1e9 * flux.pulse_fwhm, 1e9 * flux.pulse_fwhm_stderr, **look)
    space.set(
        xlabel="distance (m)", ylabel="spot, full width at half maximum (mm)", xscale="log", yscale="log"
    )
    space.legend(fontsize="x-small", ncols=2)
    pulse.set(xlabel="distance (m)", ylabel="pulse, full width at half maximum (ns)")
    return figure
