"""The water of a scene as the kernels take it: coefficients, speed of the pulse, phase function."""

from __future__ import annotations

from typing import NamedTuple

from imclab.errors import Fault, InputError
from imclab.media import Medium
from imclab.optics import phase
from imclab.optics.phase_table import PhaseTable
from imclab.scene import Scene
from imclab.transport.scattering import HenyeyGreensteinLaw

SPEED_OF_LIGHT = 299_792_458.0


class Water(NamedTuple):
    """Attenuation, absorption and scattering (1/m), albedo, phase index, speed of the pulse (m/s)."""

    attenuation: float
    absorption: float
    scattering: float
    albedo: float
    refractive_index: float
    group_velocity: float


def water_of(scene: Scene) -> tuple[Water, HenyeyGreensteinLaw | PhaseTable]:
    """Return the coefficients of a scene's water and its phase function."""
    medium = scene.medium
    if medium.type is not None or medium.particles is not None:
        raise InputError(
            "scene", [Fault("medium", "a water type or particles", "attenuation and albedo for now")]
        )
    if medium.attenuation is not None and medium.albedo is not None:
        scattering = medium.attenuation * medium.albedo
        absorption = medium.attenuation * (1.0 - medium.albedo)
    else:
        absorption, scattering = medium.absorption or 0.0, medium.scattering or 0.0
    return _water(medium, absorption, scattering), _phase_of(medium)


def _water(medium: Medium, absorption: float, scattering: float) -> Water:
    sea = medium.water != "fresh"
    refractive_index = medium.refractive_index or (1.34188 if sea else 1.33541)
    group_index = medium.group_index or (1.36419 if sea else 1.35695)
    attenuation = absorption + scattering
    albedo = scattering / attenuation if attenuation > 0.0 else 0.0
    return Water(attenuation, absorption, scattering, albedo, refractive_index, SPEED_OF_LIGHT / group_index)


def _phase_of(medium: Medium) -> HenyeyGreensteinLaw | PhaseTable:
    wanted = medium.phase_function
    if wanted is None or wanted.kind == "isotropic":
        return HenyeyGreensteinLaw(0.0)
    if wanted.kind == "henyey-greenstein":
        return HenyeyGreensteinLaw(wanted.g)
    if wanted.kind == "two-term-henyey-greenstein":
        return phase.TwoTermHenyeyGreenstein(wanted.g1, wanted.g2, wanted.weight).table()
    if wanted.kind == "rayleigh":
        return phase.Rayleigh(wanted.depolarisation).table()
    if wanted.kind == "fournier-forand":
        return phase.FournierForand(wanted.index, wanted.slope).table()
    raise InputError("scene", [Fault("medium.phase_function.kind", wanted.kind, "a closed form for now")])
