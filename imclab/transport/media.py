"""The water of a scene as the kernels take it: coefficients, speed of the pulse, phase function."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from imclab import media
from imclab.errors import Fault, InputError
from imclab.optics import particles, phase, size_distribution, water
from imclab.optics.phase_table import PhaseTable
from imclab.scene import Scene
from imclab.transport.scattering import HenyeyGreensteinLaw

SPEED_OF_LIGHT = 299_792_458.0
SEA_SALINITY = 35.0
"""Grams of salt per kilogram of sea water when the scene does not say."""


class Water(NamedTuple):
    """Attenuation, absorption and scattering (1/m), albedo, phase index, speed of the pulse (m/s)."""

    attenuation: float
    absorption: float
    scattering: float
    albedo: float
    refractive_index: float
    group_velocity: float


class _Body(NamedTuple):
    """The water without what floats in it."""

    wavelength: float
    temperature: float
    salinity: float
    refractive_index: float


def water_of(scene: Scene) -> tuple[Water, HenyeyGreensteinLaw | PhaseTable]:
    """Return the coefficients of a scene's water and its phase function.

    Raises
    ------
    InputError
        What the optics refuse: an unknown water type, a wavelength outside a table, sizes out of range.
    """
    medium, body = scene.medium, _body_of(scene)
    if medium.particles is not None:
        suspension = _suspension(scene, medium.particles, body)
        absorption, scattering = suspension.absorption, suspension.scattering
        law: HenyeyGreensteinLaw | PhaseTable = suspension.phase_function.table()
    else:
        absorption, scattering = _coefficients(medium, body.wavelength)
        law = _phase_of(scene, body)
    group_index = medium.group_index or float(
        water.group_index(body.wavelength, temperature=body.temperature, salinity=body.salinity)
    )
    attenuation = absorption + scattering
    albedo = scattering / attenuation if attenuation > 0.0 else 0.0
    velocity = SPEED_OF_LIGHT / group_index
    return Water(attenuation, absorption, scattering, albedo, body.refractive_index, velocity), law


def _body_of(scene: Scene) -> _Body:
    """Return the water itself: Jerlov's types are of the sea, other water is fresh unless it says."""
    medium, wavelength = scene.medium, scene.laser.wavelength
    kind = medium.water or ("sea" if medium.type is not None else "fresh")
    salinity = medium.salinity
    if salinity is None:
        salinity = SEA_SALINITY if kind == "sea" else 0.0
    index = medium.refractive_index or float(
        water.refractive_index(wavelength, temperature=medium.temperature, salinity=salinity)
    )
    return _Body(wavelength, medium.temperature, salinity, index)


def _coefficients(medium: media.Medium, wavelength: float) -> tuple[float, float]:
    if medium.type is not None:
        kind = water.water_type(medium.type, wavelength)
        return kind.absorption, kind.scattering
    if medium.attenuation is not None and medium.albedo is not None:
        return medium.attenuation * (1.0 - medium.albedo), medium.attenuation * medium.albedo
    return medium.absorption or 0.0, medium.scattering or 0.0


def _suspension(scene: Scene, wanted: media.Particles, body: _Body) -> particles.Suspension:
    own = water.WaterType(
        "water itself",
        "tables",
        absorption=float(
            water.absorption(body.wavelength, temperature=body.temperature, salinity=body.salinity)
        ),
        scattering=float(water.scattering(body.wavelength, salinity=body.salinity)),
    )
    attenuation = None if wanted.optical_depth is None else wanted.optical_depth / scene.target.distance
    return particles.suspension(
        _spheres(wanted, body, density=wanted.density),
        own,
        number_density=wanted.number_density,
        mass_concentration=wanted.concentration,
        attenuation=attenuation,
    )


def _spheres(
    wanted: media.Particles | media.Mie, body: _Body, *, density: float = particles.CALCITE_DENSITY
) -> particles.Particles:
    index = wanted.relative_index
    if index is None:
        assert wanted.index is not None
        index = wanted.index / body.refractive_index
    return particles.Particles(
        _sizes(wanted.diameter, wanted.size), index, body.wavelength, body.refractive_index, density
    )


def _sizes(diameter: float, spread: media.SizeSpread) -> size_distribution.SizeDistribution:
    if spread.kind == "log-normal" and spread.sigma is not None:
        return size_distribution.LogNormal(diameter, spread.sigma)
    if spread.slope is not None and spread.smallest is not None and spread.largest is not None:
        return size_distribution.Junge(spread.slope, spread.smallest, spread.largest)
    return size_distribution.SingleSize(diameter)


def _phase_of(scene: Scene, body: _Body) -> HenyeyGreensteinLaw | PhaseTable:
    """Return the phase function; a water type without one takes Petzold's average particle."""
    wanted = scene.medium.phase_function
    if wanted is None:
        return phase.petzold().table() if scene.medium.type is not None else HenyeyGreensteinLaw(0.0)
    if isinstance(wanted, media.Isotropic):
        return HenyeyGreensteinLaw(0.0)
    if isinstance(wanted, media.HenyeyGreenstein):
        return HenyeyGreensteinLaw(wanted.g)
    return _tabulated(scene, wanted, body).table()


def _tabulated(scene: Scene, wanted: media.PhaseFunction, body: _Body) -> phase.PhaseFunction:
    if isinstance(wanted, media.TwoTermHenyeyGreenstein):
        return phase.TwoTermHenyeyGreenstein(wanted.g1, wanted.g2, wanted.weight)
    if isinstance(wanted, media.Rayleigh):
        return phase.Rayleigh(wanted.depolarisation)
    if isinstance(wanted, media.FournierForand):
        return phase.FournierForand(wanted.index, wanted.slope)
    if isinstance(wanted, media.Mie):
        return _spheres(wanted, body).phase_function
    if isinstance(wanted, media.Table) and wanted.file is not None:
        return phase.Tabulated(*_read_table(scene.folder / wanted.file))
    return phase.petzold()


def _read_table(path: Path) -> tuple[list[float], list[float]]:
    """Read a file with an angle (deg) and a value (1/sr) on each line; # starts a comment."""
    try:
        angle, value = np.loadtxt(
            path, delimiter="," if path.suffix == ".csv" else None, unpack=True, ndmin=2
        )
    except (OSError, ValueError) as error:
        wanted = "a text file with an angle (deg) and a value (1/sr) on each line"
        fault = Fault("medium.phase_function.file", f'"{path.name}" ({error})', wanted)
        raise InputError("scene", [fault]) from None
    return np.radians(angle).tolist(), value.tolist()
