"""Scenes in which all imaging estimators must agree; apertures wide enough for the analog one."""

from __future__ import annotations

from typing import Any

from imclab.scene import Scene

LAMBERTIAN = {"kind": "lambertian", "reflectance": 0.9}
GROUND = {"kind": "lambertian", "reflectance": 0.1}
NICKEL = {"kind": "microfacet", "roughness": 0.1, "material": "nickel"}
MIRROR = {"kind": "microfacet", "roughness": 0.001, "material": "silver"}
DIFFUSE = {"kind": "diffuse", "body_reflectance": 0.8}


def scene(
    c: float,
    *,
    g: float = 0.924,
    albedo: float = 0.89,
    aside: float = 0.0,
    gate: dict[str, str] | None = None,
    distance: float = 1.0,
    aperture: float = 0.1,
    side: float = 0.2,
    divergence: str = "200 mrad",
    figure: dict[str, Any] | None = None,
    ground: dict[str, Any] | None = None,
    pixels: int = 4,
) -> Scene:
    """Return a scene; ``ground`` needs no mask here, the figure covers all."""
    document: dict[str, Any] = {
        "schema": 1,
        "medium": {
            "attenuation": f"{c} 1/m",
            "albedo": albedo,
            "refractive_index": 1.34,
            "group_index": 1.364,
            "phase_function": {"kind": "henyey-greenstein", "g": g},
        },
        "laser": {
            "wavelength": "532 nm",
            "pulse_energy": "1 J",
            "pulse_fwhm": "4.5 ns",
            "divergence_fwhm": divergence,
            "spot_fwhm": "1 mm",
        },
        "target": {
            "distance": f"{distance} m",
            "width": f"{side} m",
            "height": f"{side} m",
            "figure": figure or LAMBERTIAN,
        },
        "receiver": {
            "position": [f"{aside} m", "0 m", "0 m"],
            "aperture_radius": f"{aperture} m",
            "pixels": [pixels, pixels],
        },
    }
    if ground is not None:
        document["target"]["ground"] = ground
    if gate is not None:
        document["gate"] = gate
    return Scene.from_document(document)


CENTRED = {"center": "target", "width": "3 ns"}
EARLY = {"delay": "4 ns", "width": "2 ns"}
LATE = {"delay": "11.5 ns", "width": "3 ns"}

SCENES: dict[str, Scene] = {
    "clear water": scene(0.0, albedo=0.0),
    "depth 0.1": scene(0.1),
    "depth 0.42, gated": scene(0.42, gate=CENTRED),
    "depth 0.42, isotropic": scene(0.42, g=0.0, albedo=0.99),
    "depth 0.42, 20 cm aside, gated": scene(0.42, aside=0.2, gate=CENTRED),
    "depth 1.42, gated": scene(1.42, gate=CENTRED),
    "depth 1.42, g 0.6, albedo 0.5": scene(1.42, g=0.6, albedo=0.5),
    "depth 1.42, early gate": scene(1.42, gate=EARLY),
    "depth 1.42, late gate": scene(1.42, gate=LATE),
    "depth 1.42, absorbing": scene(1.42, albedo=0.0),
    "depth 1.42, 4 m": scene(0.355, distance=4.0, aperture=0.4, side=0.8),
    "depth 1.42, narrow beam": scene(1.42, divergence="20 mrad", gate=CENTRED),
    "depth 1.42, diffuse law aside": scene(1.42, aside=0.2, figure=DIFFUSE),
    "depth 1.42, nickel": scene(1.42, figure=NICKEL, gate=CENTRED),
    "depth 0.42, mirror": scene(0.42, figure=MIRROR),
    "depth 4": scene(4.0),
    "depth 4, g 0.99, gated": scene(4.0, g=0.99, gate=CENTRED),
    "depth 8, g 0.99": scene(8.0, g=0.99, albedo=0.99),
}
