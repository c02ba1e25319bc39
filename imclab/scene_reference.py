"""Write the reference of scene files from the models that check them: ``python -m imclab.scene_reference``.

Keys, kinds of value, limits and defaults come from the models; the words for each key stand here. A
key without words, and words without a key, are errors, so that the page cannot fall behind.
"""

from __future__ import annotations

import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel, BeforeValidator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from imclab import materials, media, scene, schema, units

TABLES: dict[str, type[BaseModel]] = {
    "": scene.Scene,
    "medium": media.Medium,
    "medium.particles": media.Particles,
    "medium.particles.size": media.SizeSpread,
    "laser": scene.Laser,
    "target": scene.Target,
    "receiver": scene.Receiver,
    "gate": scene.Gate,
    "detector": scene.Detector,
    "run": scene.Run,
}
KINDS: dict[str, tuple[type[BaseModel], ...]] = {
    "medium.phase_function": (
        media.HenyeyGreenstein,
        media.TwoTermHenyeyGreenstein,
        media.Isotropic,
        media.Rayleigh,
        media.FournierForand,
        media.Mie,
        media.Table,
    ),
    "target.figure": (materials.Lambertian, materials.Diffuse, materials.Microfacet),
}
WORDS = {
    "schema": "version of the format",
    "title": "a line for people, shown in reports",
    "medium": "the water",
    "laser": "the pulsed beam",
    "target": "the flat target",
    "receiver": "the camera's aperture and pixels",
    "gate": "when the intensifier is on; without this table it always is",
    "detector": "the camera from energy to counts",
    "run": "how long to simulate when the call does not say so",
    "medium.attenuation": "c; goes with `albedo`",
    "medium.albedo": "scattering over attenuation, b/c",
    "medium.absorption": "a; goes with `scattering`, in place of attenuation and albedo",
    "medium.scattering": "b; goes with `absorption`",
    "medium.type": 'a Jerlov type such as "jerlov-II", in place of coefficients',
    "medium.particles": "spheres in pure water, in place of coefficients; Mie theory gives the rest",
    "medium.phase_function": "how scattering spreads over angle; needed beside coefficients that scatter",
    "medium.water": "which pure water; gives indices and, with particles, its own absorption and scattering",
    "medium.temperature": "of the water",
    "medium.salinity": "of the water",
    "medium.refractive_index": "phase index; default: from the water tables at the wavelength",
    "medium.group_index": "index for time of flight; default: from the water tables at the wavelength",
    "medium.particles.diameter": "of the spheres, or the median of their distribution",
    "medium.particles.relative_index": "of particle over water; or give `index`",
    "medium.particles.index": "of the particle itself (calcite 1.59); or give `relative_index`",
    "medium.particles.size": "how the diameters are spread",
    "medium.particles.optical_depth": "so many particles that water and they give this up to the target",
    "medium.particles.concentration": "mass of particles per volume of water",
    "medium.particles.number_density": "particles per volume of water",
    "medium.particles.density": "of the particles' material (calcite by default)",
    "medium.particles.size.kind": "one diameter, log-normal, or a power law",
    "medium.particles.size.sigma": "geometric standard deviation of a log-normal",
    "medium.particles.size.slope": "of the power law, number per diameter",
    "medium.particles.size.smallest": "smallest diameter of the power law",
    "medium.particles.size.largest": "largest diameter of the power law",
    "medium.phase_function.kind": "which phase function",
    "medium.phase_function.g": "mean cosine of the scattering angle",
    "medium.phase_function.g1": "mean cosine of the first term",
    "medium.phase_function.g2": "mean cosine of the second term",
    "medium.phase_function.weight": "share of the first term",
    "medium.phase_function.depolarisation": "depolarisation ratio of the molecules",
    "medium.phase_function.index": "Fournier-Forand: relative index of the particles; Mie: as in particles",
    "medium.phase_function.slope": "slope of the power law of sizes",
    "medium.phase_function.diameter": "of the spheres, or the median of their distribution",
    "medium.phase_function.relative_index": "of particle over water; or give `index`",
    "medium.phase_function.size": "how the diameters are spread, as in `medium.particles.size`",
    "medium.phase_function.file": "two columns: angle (deg) and value (1/sr), beside the scene file",
    "medium.phase_function.name": "a table that is shipped",
    "laser.wavelength": "in vacuum",
    "laser.pulse_energy": "that enters the water",
    "laser.pulse_fwhm": "length of the pulse, full width at half maximum of power",
    "laser.divergence_fwhm": "full angle at half maximum of each transverse angle",
    "laser.spot_fwhm": "full width at half maximum where the beam enters the water",
    "laser.divergence_measured_in": "in air, Snell's law at a flat window is applied once",
    "target.distance": "from where the beam enters the water",
    "target.width": "along x",
    "target.height": "along y",
    "target.mask": "black and white picture beside the scene file, white is figure; without it all is figure",
    "target.figure": "material of the figure",
    "target.ground": "material of the ground, needed beside a mask; kinds as for the figure",
    "target.figure.kind": "which material",
    "target.figure.reflectance": "share of light sent back",
    "target.figure.body_reflectance": "R∞ of equation 11: an infinitely thick body",
    "target.figure.index": "diffuse: of the body, absolute; microfacet: of the metal, absolute",
    "target.figure.roughness": "root mean square slope of the facets times √2 (Beckmann's m)",
    "target.figure.material": "a metal with a tabled index",
    "receiver.position": "x, y, z of the middle of the aperture; x to the right, y down",
    "receiver.aperture_radius": "of the disc that gathers light",
    "receiver.field_of_view": "full cone angle; everything by default",
    "receiver.pixels": "columns, rows, over the target's rectangle",
    "gate.delay": "when it opens, after the pulse's peak crosses z = 0; or give `center`",
    "gate.center": "put the middle of the gate on the target's return",
    "gate.width": "how long it stays open",
    "gate.rise": "of its edges",
    "detector.calibration": "a file made by `imclab calibrate`, in place of the values below",
    "detector.quantum_efficiency": "photoelectrons per photon",
    "detector.gain": "counts of one photoelectron",
    "detector.excess_noise_factor": "F² of the micro-channel plate",
    "detector.blur_fwhm_px": "phosphor and fibres, full width at half maximum in pixels",
    "detector.counts_per_electron": "of the sensor",
    "detector.dark_counts": "offset of the sensor",
    "detector.read_noise_counts": "standard deviation of the sensor",
    "detector.response_exponent": "counts grow as signal to this power",
    "detector.bit_depth": "of the sensor",
    "detector.protection_threshold": "energy of the picture above which the intensifier shuts off",
    "run.seed": "the random numbers follow from it",
    "run.rel_error": "stop at this relative standard error of the total",
    "run.seconds": "stop after so long",
    "run.packets": "stop after so many packets",
    "run.estimator": "how to estimate; `auto` chooses by scene",
}
HEAD = """# Scene files

This page is written by `python -m imclab.scene_reference`; a test holds it to the code.

A scene is a TOML file. Quantities are text with a unit; bare numbers stand only where there is no unit.
Unknown keys are refused with the nearest name, and all faults of a file are told together. File names are
relative to the scene file. Axes, times and signs: [conventions](conventions.md). Examples: `data/scenes/`.
"""
_QUANTITIES = {
    getattr(schema, name).__metadata__[0].func: kind
    for name, kind in (
        ("Length", "length"),
        ("Time", "time"),
        ("Attenuation", "attenuation"),
        ("Angle", "angle"),
        ("Energy", "energy"),
        ("Density", "density"),
        ("NumberDensity", "number_density"),
        ("Temperature", "temperature"),
        ("Salinity", "salinity"),
    )
}
_COMPLEX = schema.ComplexIndex.__metadata__[0].func  # type: ignore[attr-defined]
_LIMIT_SIGNS: dict[str, type] = {
    ">": annotated_types.Gt,
    "≥": annotated_types.Ge,
    "<": annotated_types.Lt,
    "≤": annotated_types.Le,
}
_SIMPLE = {float: "number", int: "whole number", str: "text", bool: "true or false"}


def page() -> str:
    """Return the whole page as Markdown."""
    blocks = [HEAD]
    for path, model in TABLES.items():
        blocks.append(f"\n## {f'`[{path}]`' if path else 'Top level'}\n")
        blocks += [_head(), *(_line(path, key, item) for key, item in _fields(model))]
        for kinds_path in KINDS:
            if kinds_path.rpartition(".")[0] == path and path:
                blocks += _kinds(kinds_path)
    return "\n".join(blocks) + "\n"


def keys() -> set[str]:
    """Return every dotted key that a scene file may hold and this page must explain."""
    found = {f"{path}.{key}".lstrip(".") for path, model in TABLES.items() for key, _ in _fields(model)}
    for path, models in KINDS.items():
        found |= {f"{path}.{key}" for model in models for key, _ in _fields(model)}
    return found


def _kinds(path: str) -> Iterator[str]:
    yield f"\n### `[{path}]`\n"
    if path == "target.figure":
        yield "`[target.ground]` takes the same.\n"
    for model in KINDS[path]:
        kind = get_args(model.model_fields["kind"].annotation)[0]
        yield f'\n`kind = "{kind}"`: {_sentence(model)}\n'
        lines = [_line(path, key, item) for key, item in _fields(model) if key != "kind"]
        if lines:
            yield from (_head(), *lines)


def _sentence(model: type[BaseModel]) -> str:
    first = (model.__doc__ or "").split("\n\n")[0]
    return " ".join(first.replace("``", "`").split())


def _head() -> str:
    return "| key | value | default | what |\n|---|---|---|---|"


def _line(path: str, key: str, item: FieldInfo) -> str:
    what = WORDS[f"{path}.{key}".lstrip(".")]
    limits = _limits(item.metadata)
    value = _value(item.annotation, item.metadata) + (f", {limits}" if limits else "")
    return f"| `{key}` | {value} | {_default(item)} | {what} |"


def _fields(model: type[BaseModel]) -> Iterator[tuple[str, FieldInfo]]:
    for name, item in model.model_fields.items():
        yield item.alias or name, item


def _default(item: FieldInfo) -> str:
    if item.is_required():
        return "needed"
    if item.default in (None, "", PydanticUndefined) or isinstance(item.default, BaseModel):
        return ""
    default: Any = item.default
    quantity = next((q for q in map(_quantity_of, (item.annotation, *item.metadata)) if q), None)
    unit = f" {units.SI_UNIT[quantity][0]}" if quantity else ""
    if isinstance(default, tuple):
        return f"`[{', '.join(f'{value:g}' for value in default)}]` m"
    if isinstance(default, complex):
        return f"`{default.real:g}`"
    return f"`{default:.6g}`{unit}" if isinstance(default, float) else f"`{default}`"


def _quantity_of(annotation: Any) -> str | None:
    """Return the kind of quantity that a validator or an annotation reads."""
    if isinstance(annotation, BeforeValidator):
        return _QUANTITIES.get(annotation.func)
    if get_origin(annotation) is Annotated:
        return next(filter(None, map(_quantity_of, annotation.__metadata__)), None)
    return next(filter(None, map(_quantity_of, get_args(annotation))), None)


def _value(annotation: Any, metadata: list[Any]) -> str:
    for mark in metadata:
        if isinstance(mark, BeforeValidator):
            if mark.func is _COMPLEX:
                return 'index: `1.59`, `[1.88, 3.49]` or `"1.88 - 3.49i"`'
            kind = _QUANTITIES[mark.func]
            return f'{kind.replace("_", " ")}, as `"{units.SI_UNIT[kind][1]}"`'
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        marks = list(annotation.__metadata__)
        limits = _limits(marks)
        return _value(inner[0], marks) + (f", {limits}" if limits else "")
    if origin is Literal:
        return " or ".join(f"`{_literal(value)}`" for value in inner)
    if origin in (Union, types.UnionType):
        choices = list(dict.fromkeys(_value(choice, []) for choice in inner if choice is not type(None)))
        return " or ".join(choices)
    if origin is tuple:
        return "list of " + " and ".join(dict.fromkeys(_value(choice, []) for choice in inner))
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "a table"
    return _SIMPLE[annotation]


def _literal(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def _limits(metadata: list[Any]) -> str:
    words = []
    for mark in _flat(metadata):
        for sign, kind in _LIMIT_SIGNS.items():
            if isinstance(mark, kind):
                words.append(f"{sign} {getattr(mark, kind.__name__.lower()):.4g}")
    return ", ".join(words)


def _flat(metadata: list[Any]) -> Iterator[Any]:
    for mark in metadata:
        if isinstance(mark, FieldInfo):
            yield from mark.metadata
        else:
            yield mark


if __name__ == "__main__":
    print(page(), end="")
