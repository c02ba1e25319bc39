"""What the water can be: the kinds a scene file may name."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from imclab.schema import (
    Attenuation,
    ComplexIndex,
    Density,
    NumberDensity,
    Part,
    PositiveLength,
    Salinity,
    Temperature,
)

Asymmetry = Annotated[float, Field(ge=-1, le=1)]
Index = Annotated[float, Field(ge=1, le=3)]


class HenyeyGreenstein(Part):
    """Henyey-Greenstein phase function of asymmetry g."""

    kind: Literal["henyey-greenstein"]
    g: Asymmetry


class TwoTermHenyeyGreenstein(Part):
    """``weight`` of Henyey-Greenstein with ``g1`` and the rest with ``g2``."""

    kind: Literal["two-term-henyey-greenstein"]
    g1: Asymmetry
    g2: Asymmetry
    weight: Annotated[float, Field(ge=0, le=1)]


class Isotropic(Part):
    """The same in all directions."""

    kind: Literal["isotropic"]


class Rayleigh(Part):
    """Molecular scattering with a depolarisation ratio."""

    kind: Literal["rayleigh"]
    depolarisation: Annotated[float, Field(ge=0, lt=1)] = 0.0


class FournierForand(Part):
    """Fournier-Forand: power-law particles of a relative index and a slope."""

    kind: Literal["fournier-forand"]
    index: Annotated[float, Field(gt=1, le=1.5)]
    slope: Annotated[float, Field(gt=3, lt=5)]


class SizeSpread(Part):
    """Log-normal widths (``sigma`` the geometric standard deviation) or a power law of diameters."""

    kind: Literal["single", "log-normal", "junge"] = "single"
    sigma: Annotated[float, Field(gt=1, le=5)] | None = None
    slope: Annotated[float, Field(gt=1, le=8)] | None = None
    smallest: PositiveLength | None = None
    largest: PositiveLength | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        wanted = {"single": (), "log-normal": ("sigma",), "junge": ("slope", "smallest", "largest")}[
            self.kind
        ]
        given = [
            name for name in ("sigma", "slope", "smallest", "largest") if getattr(self, name) is not None
        ]
        if sorted(given) != sorted(wanted):
            raise ValueError(f"wanted for kind {self.kind!r} just these keys: {', '.join(wanted) or 'none'}")
        return self


class _Spheres(Part):
    diameter: PositiveLength
    relative_index: ComplexIndex | None = None
    index: ComplexIndex | None = None
    size: SizeSpread = SizeSpread()

    @model_validator(mode="after")
    def _one_index(self) -> Self:
        if (self.relative_index is None) == (self.index is None):
            raise ValueError("wanted either relative_index (to the water) or index (absolute)")
        return self


class Mie(_Spheres):
    """Spheres of one diameter or of a distribution around it (eqs. 4-6)."""

    kind: Literal["mie"]


class Table(Part):
    """A measured phase function: a file of angle (deg) and value (1/sr), or "petzold-average"."""

    kind: Literal["table"]
    file: str | None = None
    name: Literal["petzold-average"] | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.file is None) == (self.name is None):
            raise ValueError('wanted either file or name = "petzold-average"')
        return self


PhaseFunction = Annotated[
    HenyeyGreenstein | TwoTermHenyeyGreenstein | Isotropic | Rayleigh | FournierForand | Mie | Table,
    Field(discriminator="kind"),
]


class Particles(_Spheres):
    """Spheres in pure water, as many as give an optical depth over the target distance, or so many."""

    optical_depth: Annotated[float, Field(gt=0)] | None = None
    concentration: Density | None = None
    number_density: NumberDensity | None = None
    density: Density = 2710.0

    @model_validator(mode="after")
    def _one_amount(self) -> Self:
        if sum(v is not None for v in (self.optical_depth, self.concentration, self.number_density)) != 1:
            raise ValueError("wanted exactly one of optical_depth, concentration, number_density")
        return self


class Medium(Part):
    """The water, by its coefficients, by a Jerlov type, or by the particles in it."""

    attenuation: Attenuation | None = None
    albedo: Annotated[float, Field(ge=0, le=1)] | None = None
    absorption: Attenuation | None = None
    scattering: Attenuation | None = None
    type: str | None = None
    particles: Particles | None = None
    phase_function: PhaseFunction | None = None
    water: Literal["fresh", "sea"] | None = None
    temperature: Temperature = 293.15
    salinity: Salinity | None = None
    refractive_index: Index | None = None
    group_index: Index | None = None

    @model_validator(mode="after")
    def _one_description(self) -> Self:
        pairs = ((self.attenuation, self.albedo), (self.absorption, self.scattering))
        for names, pair in zip((("attenuation", "albedo"), ("absorption", "scattering")), pairs, strict=True):
            if (pair[0] is None) != (pair[1] is None):
                raise ValueError(f"wanted {names[0]} and {names[1]} together")
        ways = [pairs[0][0] is not None, pairs[1][0] is not None, self.type is not None, bool(self.particles)]
        if sum(ways) != 1:
            raise ValueError(
                "wanted one description of the water: attenuation with albedo, absorption with scattering, "
                'type = "jerlov-II", or [medium.particles]'
            )
        scatters = (
            self.type is not None
            or (self.attenuation or 0) * (self.albedo or 0) > 0
            or (self.scattering or 0) > 0
        )
        if scatters and self.type is None and self.phase_function is None:
            raise ValueError(
                'wanted [medium.phase_function], for example kind = "henyey-greenstein", g = 0.924'
            )
        if self.particles is not None and self.phase_function is not None:
            raise ValueError("wanted no phase_function beside particles: Mie theory gives it")
        return self
