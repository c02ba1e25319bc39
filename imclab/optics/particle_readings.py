"""What a sentence like "calcium carbonate of relative index 1.59 and size 3 um" can mean, side by side.

The index may be that of the material (calcite: 1.60) or relative to the water; the size may be the
diameter or the radius. Extinction hardly notices the index, backscatter does, by a factor of 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from imclab.optics import water as water_tables
from imclab.optics.limits import check, refuse
from imclab.optics.particles import CALCITE_DENSITY, Particles, Suspension, suspension
from imclab.optics.phase import PhaseFunction
from imclab.optics.size_distribution import LogNormal, SingleSize, SizeDistribution

SPREAD = 1.1
_SALINITY = {"fresh": 0.0, "sea": 35.0, "none": 0.0}


@dataclass(frozen=True)
class Powder:
    """What was said of the powder and of the water.

    Attributes
    ----------
    diameter : float
        The size given, m.
    index : complex
        The index given.
    wavelength : float
        In vacuum, m.
    density : float
        In kg/m**3.
    sigma : float or None
        Geometric standard deviation of log-normal sizes; None for one size.
    water : str
        "fresh", "sea", or "none": fresh water whose own attenuation is left out.
    """

    diameter: float
    index: complex
    wavelength: float = 532e-9
    density: float = CALCITE_DENSITY
    sigma: float | None = None
    water: str = "fresh"


@dataclass(frozen=True)
class Amount:
    """How much there is: exactly one of optical depth over ``path``, mass or number per volume."""

    optical_depth: float | None = None
    path: float = 1.0
    mass_concentration: float | None = None
    number_density: float | None = None


@dataclass(frozen=True, eq=False)
class Reading:
    """One reading: its name, its numbers (keys carry their units), its phase function."""

    name: str
    values: dict[str, Any]
    phase_function: PhaseFunction


def read(powder: Powder, amount: Amount) -> list[Reading]:
    """Return the four readings, the likely one first: index of the material, size the diameter.

    Raises
    ------
    InputError
        A value outside its range, an unknown water, or not exactly one measure of the amount.
    """
    if powder.water not in _SALINITY:
        raise refuse("water", repr(powder.water), ", ".join(_SALINITY))
    check("path", amount.path, 0.0, 1e6, unit="m", open_low=True)
    salinity = _SALINITY[powder.water]
    medium_index = float(water_tables.refractive_index(powder.wavelength, salinity=salinity))
    absolute = powder.index / medium_index
    readings = []
    for size_name, factor in (("diameter", 1.0), ("radius", 2.0)):
        for index_name, relative in (("absolute", absolute), ("relative", powder.index)):
            sizes = _sizes(powder.diameter * factor, powder.sigma)
            spheres = Particles(sizes, relative, powder.wavelength, medium_index, powder.density)
            mixed = _suspend(spheres, powder, amount)
            name = f"{index_name} index, {size_name}"
            values = {"reading": name, **_numbers(mixed, powder.diameter * factor)}
            values["index_note"] = f"{powder.index.real:g} is an index against vacuum, the size a diameter"
            readings.append(Reading(name, values, mixed.phase_function))
    return readings


def _sizes(diameter: float, sigma: float | None) -> SizeDistribution:
    return SingleSize(diameter) if sigma is None else LogNormal(diameter, sigma)


def _suspend(spheres: Particles, powder: Powder, amount: Amount) -> Suspension:
    own = None
    if powder.water != "none":
        own = water_tables.pure_water(powder.wavelength, salinity=_SALINITY[powder.water])
    wanted = None if amount.optical_depth is None else amount.optical_depth / amount.path
    return suspension(
        spheres,
        own,
        number_density=amount.number_density,
        mass_concentration=amount.mass_concentration,
        attenuation=wanted,
    )


def _numbers(mixed: Suspension, diameter: float) -> dict[str, Any]:
    spheres = mixed.particles
    x = np.pi * diameter * spheres.medium_index / spheres.wavelength
    phase = mixed.phase_function
    spread = Suspension(_spread(spheres, diameter), mixed.number_density, mixed.water)
    index = complex(spheres.relative_index)
    return {
        "relative_index": [index.real, -abs(index.imag)],
        "relative_index_text": f"{index.real:.4f}" + (f" - {abs(index.imag):.4g}i" if index.imag else ""),
        "medium_index": spheres.medium_index,
        "diameter_um": diameter * 1e6,
        "size_parameter": x,
        "extinction_efficiency": spheres.cross_sections.extinction / spheres.mean_area,
        "attenuation_per_m": mixed.attenuation,
        "absorption_per_m": mixed.absorption,
        "scattering_per_m": mixed.scattering,
        "water_attenuation_per_m": mixed.water.attenuation if mixed.water else 0.0,
        "albedo": mixed.albedo,
        "asymmetry": phase.asymmetry,
        "particle_asymmetry": spheres.phase_function.asymmetry,
        "backscatter_fraction": phase.backscatter_fraction,
        "backscatter_phase_per_sr": float(phase.evaluate(-1.0)),
        "backscatter_phase_spread_per_sr": float(spread.phase_function.evaluate(-1.0)),
        "number_density_per_m3": mixed.number_density,
        "grams_per_litre": mixed.mass_concentration,
    }


def _spread(spheres: Particles, diameter: float) -> Particles:
    """Return the same particles with log-normal sizes of 10 % width."""
    return Particles(
        LogNormal(diameter, SPREAD),
        spheres.relative_index,
        spheres.wavelength,
        spheres.medium_index,
        spheres.density,
    )
