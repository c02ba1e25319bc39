"""Surfaces: directional albedo by quadrature and by sampling, reciprocity, hostile directions.

``python -m tests.figures.optics_surfaces`` prints one line for each surface; ten million hostile
directions each for roughness 1e-4 to 1.
"""

from __future__ import annotations

import math

import numpy as np

from imclab.optics.surface import Microfacet
from imclab.transport import surfaces
from tests.physics.test_surfaces import ANGLES, MATERIALS, SILVER, direction, hostile, run

DRAWS = 2_000_000
HOSTILE = 10_000_000


def furnace() -> None:
    print("directional albedo by quadrature, and sampling minus quadrature in standard errors")
    print("surface       " + "".join(f"{degrees:>18g} deg" for degrees in ANGLES))
    rng = np.random.default_rng(3)
    for name, material in MATERIALS.items():
        told = []
        for degrees in ANGLES:
            w_in = direction(degrees)
            albedo = material.directional_albedo(w_in[2])
            mean, error, _ = run(material.parameters, w_in, rng.random((DRAWS, 2)))
            deviation = (mean - albedo) / error if error > 1e-9 else 0.0
            told.append(f"{albedo:14.6f} ({deviation:+4.1f})")
        print(f"{name:14s}" + " ".join(told))


def reciprocity() -> None:
    rng = np.random.default_rng(4)
    worst = 0.0
    for name, material in MATERIALS.items():
        if name == "diffuse":
            continue
        for degrees in ANGLES:
            w_in = direction(degrees)
            for w_out in material.sample(w_in, rng.random((2000, 2))).w_out:
                if w_out[2] > 0:
                    there = surfaces.evaluate(material.parameters, w_in, tuple(w_out))
                    back = surfaces.evaluate(material.parameters, tuple(w_out), w_in)
                    worst = max(worst, abs(there - back) / max(there, 1e-300))
    print(f"\nreciprocity, worst relative difference: {worst:.1e}")


def hostile_directions() -> None:
    rng = np.random.default_rng(5)
    roughness = (1e-4, 1e-3, 0.01, 0.1, 1.0)
    bad = 0
    for m in roughness:
        for _ in range(10):
            bad += hostile(Microfacet(m, SILVER).parameters, rng.random((HOSTILE // 10, 4)))
    told = f"{HOSTILE * len(roughness):.0e} random and grazing directions, roughness 1e-4 to 1"
    print(f"{told}: {bad} not finite, negative, or above their bound")


if __name__ == "__main__":
    assert math.isclose(MATERIALS["lambertian"].directional_albedo(0.5), 0.3)
    furnace()
    reciprocity()
    hostile_directions()
