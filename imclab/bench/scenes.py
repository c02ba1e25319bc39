"""The scenes of the bench when none is given, and their variations."""

from __future__ import annotations

from typing import Any

from imclab.scene import Scene

_DOCUMENT: dict[str, Any] = {
    "schema": 1,
    "title": "Lambertian target at 1 m, gated, coaxial",
    "medium": {
        "attenuation": "0.42 1/m",
        "albedo": 0.89,
        "refractive_index": 1.34,
        "group_index": 1.364,
        "phase_function": {"kind": "henyey-greenstein", "g": 0.924},
    },
    "laser": {
        "wavelength": "532 nm",
        "pulse_energy": "20 uJ",
        "pulse_fwhm": "4.5 ns",
        "divergence_fwhm": "200 mrad",
        "spot_fwhm": "1 mm",
    },
    "target": {
        "distance": "1 m",
        "width": "5 cm",
        "height": "5 cm",
        "figure": {"kind": "lambertian", "reflectance": 0.9},
    },
    "receiver": {"aperture_radius": "12.5 mm", "pixels": [200, 200]},
    "gate": {"center": "target", "width": "3 ns"},
}


def target_scene() -> Scene:
    """Return a uniform Lambertian target behind 1 m of the paper's water."""
    return Scene.from_document(_DOCUMENT, source="bench")


def slab_scene(optical_depth: float, *, albedo: float, asymmetry: float) -> Scene:
    """Return 1 m of water before a beam that is as good as parallel."""
    return target_scene().with_(
        **{
            "medium.attenuation": f"{optical_depth!r} 1/m",
            "medium.albedo": albedo,
            "medium.phase_function": {"kind": "henyey-greenstein", "g": asymmetry},
            "laser.divergence_fwhm": "1 urad",
        }
    )


def with_optical_depth(scene: Scene, optical_depth: float) -> Scene:
    """Return a scene of another optical depth, its albedo kept; only where attenuation is given."""
    return scene.with_(**{"medium.attenuation": f"{optical_depth / scene.target.distance!r} 1/m"})
