"""Spheres in water: how much of them makes which water, and which water so much of them makes.

Symbols: c, b, a coefficients of attenuation, scattering, absorption in 1/m; index w the water's own.
Eq. 7 of the paper, ``c = N <Q_ext pi r**2>``, with the water that the paper leaves out:
``c = a_w + b_w + c_particles``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imclab.optics import mie
from imclab.optics.limits import check, refuse
from imclab.optics.phase import Mie, Mixture, PhaseFunction
from imclab.optics.size_distribution import SingleSize, SizeDistribution
from imclab.optics.water import WaterType
from imclab.optics.water import phase_function as water_phase_function

Array = NDArray[np.float64]

CALCITE_DENSITY = 2710.0


class CrossSections(NamedTuple):
    """Mean cross sections of one particle in m**2."""

    extinction: float
    scattering: float
    absorption: float


@dataclass(frozen=True, eq=False)
class Particles:
    """What floats in the water: sizes, index and density of homogeneous spheres.

    Parameters
    ----------
    sizes : SizeDistribution or float
        Sizes; a number is one diameter in m. Backscatter of one size is a lottery: p(180 deg) moves by
        a factor of 4 when x moves by 0.5 %.
    relative_index : complex
        Index of the material divided by that of the water, n - ik (either sign of k).
    wavelength : float
        In vacuum, m, 100 nm to 100 um.
    medium_index : float
        Phase index of the water, 1 to 3.
    density : float
        Density of the material in kg/m**3, 1 to 30,000; calcite when left out.

    Raises
    ------
    InputError
        A value lies outside its range, also the size parameters that follow.
    """

    sizes: SizeDistribution | float
    relative_index: complex
    wavelength: float
    medium_index: float
    density: float = CALCITE_DENSITY

    def __post_init__(self) -> None:
        check("wavelength", self.wavelength, 1e-7, 1e-4, unit="m")
        check("medium_index", self.medium_index, 1.0, 3.0)
        check("density", self.density, 1.0, 3e4, unit="kg/m**3")
        check("relative index (real part)", complex(self.relative_index).real, 0.0, mie.LARGEST_INDEX)
        if complex(self.relative_index) == 1.0:
            raise refuse("relative index", "1", "an index that differs from that of the water")
        if not isinstance(self.sizes, SizeDistribution):
            object.__setattr__(self, "sizes", SingleSize(float(self.sizes)))

    @classmethod
    def of_material(
        cls,
        sizes: SizeDistribution | float,
        index: complex,
        *,
        wavelength: float,
        medium_index: float,
        density: float = CALCITE_DENSITY,
    ) -> Particles:
        """Return particles of a material whose ``index`` is known against vacuum (calcite: 1.60)."""
        check("medium_index", medium_index, 1.0, 3.0)
        return cls(sizes, complex(index) / medium_index, wavelength, medium_index, density)

    @cached_property
    def _nodes(self) -> tuple[Array, Array, Array]:
        """Diameters, shares of the number, size parameters."""
        assert isinstance(self.sizes, SizeDistribution)
        diameters, shares = self.sizes.nodes()
        return diameters, shares, np.pi * diameters * self.medium_index / self.wavelength

    @cached_property
    def cross_sections(self) -> CrossSections:
        """Mean cross sections of one particle in m**2."""
        diameters, shares, x = self._nodes
        efficiencies = mie.efficiencies(x, self.relative_index)
        area = shares * 0.25 * np.pi * diameters**2
        return CrossSections(
            float(area @ efficiencies.extinction),
            float(area @ efficiencies.scattering),
            float(area @ efficiencies.absorption),
        )

    @cached_property
    def mean_area(self) -> float:
        """Mean geometric cross section of one particle in m**2."""
        diameters, shares, _ = self._nodes
        return float(0.25 * np.pi * (shares @ diameters**2))

    @cached_property
    def mean_mass(self) -> float:
        """Mean mass of one particle in kg."""
        diameters, shares, _ = self._nodes
        return float(self.density * np.pi / 6.0 * (shares @ diameters**3))

    @cached_property
    def phase_function(self) -> Mie:
        """Phase function of all sizes together, without the water."""
        _, shares, x = self._nodes
        return Mie(x, self.relative_index, shares)


@dataclass(frozen=True, eq=False)
class Suspension:
    """Particles in water.

    Attributes
    ----------
    particles : Particles
        What floats.
    number_density : float
        Particles per m**3.
    water : WaterType or None
        The water itself; None leaves it out, as the paper does.
    """

    particles: Particles
    number_density: float
    water: WaterType | None = None

    @property
    def mass_concentration(self) -> float:
        """Mass of particles in kg/m**3, which is grams per litre."""
        return self.number_density * self.particles.mean_mass

    @property
    def absorption(self) -> float:
        """Absorption coefficient a in 1/m."""
        own = self.water.absorption if self.water else 0.0
        return own + self.number_density * self.particles.cross_sections.absorption

    @property
    def scattering(self) -> float:
        """Scattering coefficient b in 1/m."""
        own = self.water.scattering if self.water else 0.0
        return own + self.number_density * self.particles.cross_sections.scattering

    @property
    def attenuation(self) -> float:
        """Attenuation coefficient ``c = a + b`` in 1/m."""
        return self.absorption + self.scattering

    @property
    def albedo(self) -> float:
        """Single scattering albedo ``b / c``."""
        return self.scattering / self.attenuation

    @cached_property
    def phase_function(self) -> PhaseFunction:
        """Phase function of particles and water in the proportion of what they scatter."""
        if self.water is None:
            return self.particles.phase_function
        weights = (self.number_density * self.particles.cross_sections.scattering, self.water.scattering)
        return Mixture((self.particles.phase_function, water_phase_function()), weights)

    @property
    def asymmetry(self) -> float:
        """Mean cosine of the scattering angle."""
        return self.phase_function.asymmetry


def suspension(
    particles: Particles,
    water: WaterType | None = None,
    *,
    number_density: float | None = None,
    mass_concentration: float | None = None,
    attenuation: float | None = None,
) -> Suspension:
    """Return a suspension from exactly one measure of how much there is.

    Parameters
    ----------
    particles : Particles
        What floats.
    water : WaterType, optional
        The water itself; without it the particles are alone, as in the paper.
    number_density : float
        Particles per m**3.
    mass_concentration : float
        In kg/m**3, which is grams per litre.
    attenuation : float
        Wanted attenuation coefficient of the whole in 1/m (optical depth divided by path), the water's
        own included.

    Raises
    ------
    InputError
        None or several measures, one that is not positive, or a wanted attenuation below the water's.
    """
    given = {
        "number_density": number_density,
        "mass_concentration": mass_concentration,
        "attenuation": attenuation,
    }
    named = {name: value for name, value in given.items() if value is not None}
    if len(named) != 1:
        raise refuse(
            "amount of particles", ", ".join(named) or "nothing", f"exactly one of {', '.join(given)}"
        )
    for name, value in named.items():
        check(name, value, 0.0, 1e40, open_low=True)
    if number_density is not None:
        return Suspension(particles, number_density, water)
    if mass_concentration is not None:
        return Suspension(particles, mass_concentration / particles.mean_mass, water)
    assert attenuation is not None
    own = water.attenuation if water else 0.0
    if attenuation <= own:
        advice = "Leave the water out if the optical depth is meant of the particles alone"
        came = f"{attenuation:.4g} 1/m"
        raise refuse("attenuation", came, f"more than the water's own, {own:.4g} 1/m", advice=advice)
    return Suspension(particles, (attenuation - own) / particles.cross_sections.extinction, water)
