"""What a target can be made of: the kinds a scene file may name."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from imclab.schema import ComplexIndex, Part

Reflectance = Annotated[float, Field(ge=0, le=1)]


class Lambertian(Part):
    """Sends the share ``reflectance`` of the light back with the same radiance everywhere."""

    kind: Literal["lambertian"]
    reflectance: Reflectance


class Diffuse(Part):
    """The diffuse law of eqs. 10-12: light that enters the body, scatters and leaves again.

    ``body_reflectance`` is the paper's R-infinity, ``index`` (absolute) gives the Fresnel part.
    """

    kind: Literal["diffuse"]
    body_reflectance: Reflectance
    index: ComplexIndex = 1.5 + 0j


class Microfacet(Part):
    """Mirror facets of Gaussian slopes (eqs. 8, 9) of a named metal or a given absolute index."""

    kind: Literal["microfacet"]
    roughness: Annotated[float, Field(gt=0, le=1)]
    material: Literal["silver", "nickel"] | None = None
    index: ComplexIndex | None = None

    @model_validator(mode="after")
    def _one_index(self) -> Self:
        if (self.material is None) == (self.index is None):
            raise ValueError('wanted either material ("silver", "nickel") or index')
        return self


Material = Annotated[Lambertian | Diffuse | Microfacet, Field(discriminator="kind")]
