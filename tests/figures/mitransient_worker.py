"""Gated pictures by mitransient; ``peers_pictures`` runs this file with mitransient's interpreter.

The laser is a projector at the origin, the camera a thin lens there, the water a box of index-matched
walls, the target a rectangle: see docs/peers.md for what differs from the scene.
"""

from __future__ import annotations

import json
import math
import os
import resource
import sys
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_mono")
import mitransient  # noqa: E402  (registers its plugins with the variant)

GAP = 2e-4
"""Space between camera and water, m: the integrator knows no camera inside a medium."""
BACK = 1e-3
"""Water behind the target, m, so that the target does not lie in a wall of the water."""
SIDE = 10.0
BEAM_HALF_ANGLE, BEAM_TEXELS = 0.45, 1024
"""The projector's picture of the beam: five standard deviations of 200 mrad FWHM each way."""
BIN_PATH, BINS = 1 / 32, 64


def irradiance(sigma: float) -> np.ndarray:
    """Return what a beam of one watt, Rayleigh in the polar angle, sends through a plane at unit distance.

    The projector multiplies its picture by pi, hence the division: clear water shows that it is right.
    """
    edge = math.tan(BEAM_HALF_ANGLE)
    across = edge * (2.0 * (np.arange(BEAM_TEXELS) + 0.5) / BEAM_TEXELS - 1.0)
    polar = np.arctan(np.hypot(*np.meshgrid(across, across)))
    intensity = np.exp(-(polar**2) / (2.0 * sigma**2)) / (2.0 * np.pi * sigma**2) * polar / np.sin(polar)
    return intensity * np.cos(polar) ** 3 / np.pi


def texture(values: np.ndarray, kind: str) -> dict[str, Any]:
    bitmap = mi.Bitmap(np.ascontiguousarray(values, dtype=np.float32)[..., None])
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": kind}


def facing_the_target() -> Any:
    return mi.ScalarTransform4f().look_at(origin=[0, 0, 0], target=[0, 0, 1], up=[0, -1, 0])


def camera(job: dict[str, Any]) -> dict[str, Any]:
    film = {
        "type": "transient_hdr_film",
        "width": job["pixels"],
        "height": job["pixels"],
        "temporal_bins": BINS,
        "bin_width_opl": BIN_PATH,
        "start_opl": 2.0 * job["distance"] - BIN_PATH / 2,
        "rfilter": {"type": "box"},
    }
    return {
        "type": "thinlens",
        "fov": math.degrees(2.0 * math.atan(job["width"] / 2 / job["distance"])),
        "aperture_radius": job["aperture"],
        "focus_distance": job["distance"],
        "near_clip": 1e-5,
        "far_clip": 100.0,
        "to_world": facing_the_target(),
        "film": film,
        "sampler": {"type": "independent"},
    }


def scene_of(job: dict[str, Any]) -> Any:
    place = mi.ScalarTransform4f()
    depth = job["distance"] + BACK
    half = job["width"] / 2
    water = {
        "type": "homogeneous",
        "sigma_t": job["attenuation"],
        "albedo": job["albedo"],
        "phase": {"type": "hg", "g": job["asymmetry"]},
    }
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {
                "type": "transient_prbvolpath",
                "max_depth": job["max_depth"],
                "rr_depth": job["roulette_depth"],
            },
            "camera": camera(job),
            "laser": {
                "type": "projector",
                "irradiance": texture(irradiance(job["divergence_sigma"]), "bilinear"),
                "fov": math.degrees(2.0 * BEAM_HALF_ANGLE),
                "to_world": facing_the_target(),
            },
            "target": {
                "type": "rectangle",
                "to_world": place.translate([0, 0, job["distance"]])
                .rotate([1, 0, 0], 180)
                .scale([half, half, 1]),
                # A rectangle turned to face the camera shows its texture upside down.
                "bsdf": {
                    "type": "diffuse",
                    "reflectance": texture(np.load(job["reflectance"])[::-1], "nearest"),
                },
            },
            "water": {
                "type": "cube",
                "to_world": place.translate([0, 0, (depth + GAP) / 2]).scale([SIDE, SIDE, (depth - GAP) / 2]),
                "bsdf": {"type": "null"},
                "interior": water,
            },
        }
    )


def gated(frames: np.ndarray, job: dict[str, Any]) -> np.ndarray:
    """Return J per pixel: frames of radiance weighed with the pulse's share inside the gate."""
    delays = BIN_PATH * np.arange(BINS) / job["group_speed"]
    sigma, half = job["pulse_sigma"], job["gate_width"] / 2
    share = np.array(
        [math.erf((half - d) / sigma / 2**0.5) - math.erf((-half - d) / sigma / 2**0.5) for d in delays]
    )
    pixel = job["width"] / job["pixels"]
    across = pixel * (np.arange(job["pixels"]) + 0.5 - job["pixels"] / 2)
    x, y = np.meshgrid(across, across)
    # Energy is radiance times etendue; over the aperture the cosine of a pixel's rays hardly varies.
    square = job["distance"] ** 2 + x * x + y * y + job["aperture"] ** 2 / 2
    etendue = math.pi * job["aperture"] ** 2 * pixel**2 * job["distance"] ** 2 / square**2
    return job["pulse_energy"] * etendue * (frames[..., 0] @ (share / 2))


def cpu_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def main() -> None:
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print must not mix with answers
    dr.set_thread_count(1)
    scene, job = None, {}
    for line in sys.stdin:
        request = json.loads(line)
        answer: dict[str, Any] = {}
        if request["what"] == "versions":
            answer = {
                "mitransient": mitransient.__version__,
                "mitsuba": mi.__version__,
                "drjit": dr.__version__,
            }
        elif request["what"] == "scene":
            job = request["job"]
            scene = scene_of(job)
        else:
            start = cpu_seconds()
            _, frames = scene.integrator().render(scene, seed=request["seed"], spp=request["samples"])
            picture = gated(np.array(frames), job)
            answer = {"cpu": cpu_seconds() - start}
            np.save(request["to"], picture)
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
