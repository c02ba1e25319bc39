"""The materials of a scene's target as the kernels take them."""

from __future__ import annotations

from imclab import materials
from imclab.optics import surface
from imclab.optics.metals import metal_index
from imclab.optics.reflection import Surface


def surface_of(material: materials.Material, refractive_index: float, wavelength: float) -> Surface:
    """Return the parameters of a material in water of a refractive index at a wavelength (m)."""
    if isinstance(material, materials.Lambertian):
        return surface.Lambertian(material.reflectance).parameters
    if isinstance(material, materials.Diffuse):
        return surface.Diffuse(material.body_reflectance, material.index / refractive_index).parameters
    index = (
        material.index
        if material.index is not None
        else metal_index(material.material or "silver", wavelength)
    )
    return surface.Microfacet(material.roughness, index / refractive_index).parameters
