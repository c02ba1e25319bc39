"""``imclab particles``: how much powder makes which water, by Mie theory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from imclab.commands.console import JSON_OPTION, emit

if TYPE_CHECKING:
    from imclab.optics.particle_readings import Reading


def particles(
    diameter: Annotated[str, typer.Option(help='Size of the particles, such as "3 um".')],
    index: Annotated[str, typer.Option(help='Refractive index, such as 1.59 or "1.59-0.001j".')],
    optical_depth: Annotated[
        float | None,
        typer.Option(help="Wanted attenuation coefficient times path, the water's own included."),
    ] = None,
    path: Annotated[str, typer.Option(help="Path of the optical depth.")] = "1 m",
    concentration: Annotated[str | None, typer.Option(help='Mass per volume, such as "1 mg/l".')] = None,
    number_density: Annotated[str | None, typer.Option(help='Particles per volume: "5e10 1/m^3".')] = None,
    wavelength: Annotated[str, typer.Option(help="Wavelength in vacuum.")] = "532 nm",
    density: Annotated[str, typer.Option(help="Density of the material; calcite's.")] = "2710 kg/m^3",
    sigma: Annotated[
        float | None, typer.Option(help="Geometric standard deviation of log-normal sizes; else one size.")
    ] = None,
    water: Annotated[str, typer.Option(help="fresh, sea, or none to leave the water's own out.")] = "fresh",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Plot of phase function against angle (PNG, PDF, SVG)."),
    ] = None,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Print c, b, albedo, g, number density and grams per litre for every reading of index and size."""
    from imclab.optics.particle_readings import Amount, Powder, read

    powder = Powder(
        diameter=_quantity("--diameter", diameter, "length"),
        index=_index(index),
        wavelength=_quantity("--wavelength", wavelength, "length"),
        density=_quantity("--density", density, "density"),
        sigma=sigma,
        water=water,
    )
    _check_one_amount(optical_depth, concentration, number_density)
    _check_above_zero("--optical-depth", optical_depth)
    amount = Amount(
        optical_depth=optical_depth,
        path=_quantity("--path", path, "length"),
        mass_concentration=_optional("--concentration", concentration, "density"),
        number_density=_optional("--number-density", number_density, "number_density"),
    )
    readings = read(powder, amount)
    data: dict[str, Any] = {**readings[0].values, "readings": [r.values for r in readings]}
    text = _table(readings)
    if output is not None:
        _plot(readings, output)
        data["plot"], text = str(output), f"{text}\nwrote {output}"
    emit(data, text, as_json=as_json)


def _plot(readings: list[Reading], output: Path) -> None:
    from imclab.errors import Fault, InputError
    from imclab.files import written_whole

    form = output.suffix.lower().removeprefix(".")
    if form not in _PLOT_FORMS:
        wanted = f"a name ending in {', '.join(f'.{name}' for name in _PLOT_FORMS)}"
        raise InputError("imclab particles", [Fault("--output", repr(str(output)), wanted)])
    from imclab.report.phase_figure import phase_figure

    figure = phase_figure({reading.name: reading.phase_function for reading in readings})
    with written_whole(output) as temporary:
        figure.savefig(temporary, format=form, dpi=150)


def _quantity(option: str, text: str, kind: str) -> float:
    from imclab.errors import Fault, InputError
    from imclab.units import UnitError, parse

    try:
        return parse(text, kind)
    except UnitError as error:
        wanted = str(error).rpartition("wanted ")[2]
        raise InputError("imclab particles", [Fault(option, repr(text), wanted)]) from None


def _optional(option: str, text: str | None, kind: str) -> float | None:
    return None if text is None else _quantity(option, text, kind)


def _check_one_amount(*given: object) -> None:
    from imclab.errors import Fault, InputError

    count = sum(value is not None for value in given)
    if count != 1:
        wanted = "exactly one of --optical-depth, --concentration, --number-density"
        raise InputError("imclab particles", [Fault("amount of particles", f"{count} options", wanted)])


def _check_above_zero(option: str, value: float | None) -> None:
    from imclab.errors import Fault, InputError

    if value is not None and not value > 0:
        raise InputError("imclab particles", [Fault(option, f"{value:g}", "a number above 0")])


def _index(text: str) -> complex:
    from imclab.errors import Fault, InputError

    try:
        return complex(text.replace(" ", "").replace("i", "j"))
    except ValueError:
        wanted = 'a number such as 1.59, or "1.59-0.001j" for a material that absorbs'
        raise InputError("imclab particles", [Fault("--index", repr(text), wanted)]) from None


def _table(readings: list[Reading]) -> str:
    """One column for each reading, one line for each quantity."""
    lines = [["", *(reading.name for reading in readings)]]
    for label, key, form in _LINES:
        lines.append([label, *(format(reading.values[key], form) for reading in readings)])
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    rows = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]
    first = readings[0].values
    own = first["water_attenuation_per_m"]
    notes = [
        f"The water's own part of c is {own:.4g} 1/m." if own else "The water's own part of c is left out.",
        f"The first column is the likely one: {first['index_note']}.",
        "p(180 deg) of one size is a lottery: half a percent in size can move it by a factor of 4.",
    ]
    return "\n".join([row.rstrip() for row in rows] + [""] + notes)


_PLOT_FORMS = ("png", "pdf", "svg")

_LINES = (
    ("relative index m", "relative_index_text", ""),
    ("diameter / um", "diameter_um", ".4g"),
    ("size parameter x", "size_parameter", ".4f"),
    ("Q_ext", "extinction_efficiency", ".4f"),
    ("attenuation c / (1/m)", "attenuation_per_m", ".4f"),
    ("scattering b / (1/m)", "scattering_per_m", ".4f"),
    ("albedo b/c", "albedo", ".4f"),
    ("asymmetry g", "asymmetry", ".4f"),
    ("backscattered b_b/b", "backscatter_fraction", ".4f"),
    ("p(180 deg) / (1/sr), as given", "backscatter_phase_per_sr", ".4f"),
    ("p(180 deg), sizes spread 10 %", "backscatter_phase_spread_per_sr", ".4f"),
    ("number density / (1/m^3)", "number_density_per_m3", ".4e"),
    ("grams per litre", "grams_per_litre", ".4e"),
)
