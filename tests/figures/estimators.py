"""Figures of merit of the imaging estimators: ``python -m tests.figures.estimators [SEEDS]``.

The scene is the gated 200 x 200 picture of the Lambertian double slit at 1 m (HG 0.924, albedo 0.89,
12.5 mm aperture, 200 mrad). Figure of merit is 1/(relative variance x CPU seconds). The analog estimator
has too few hits in 12.5 mm: its figure is measured at 10 cm and scaled by the area of the aperture.
CPU seconds are those inside the kernels, of one thread, compiling not counted.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import imclab
from imclab.result import Result
from imclab.scene import Scene

SCENE = Path(__file__).parents[2] / "data" / "scenes" / "lambertian_slit.toml"
WIDE, NARROW = 0.1, 0.0125
DEPTHS = (0.42, 1.42, 4.0)
ANALOG_PACKETS = {0.42: 6e6, 1.42: 1.2e7, 4.0: 4e7}
AUTO_PACKETS = 960_000


def scene_at(depth: float) -> Scene:
    """Return the scene at an optical depth."""
    return imclab.load_scene(SCENE).with_(**{"medium.attenuation": f"{depth} 1/m"})


def merit(result: Result) -> float:
    """Return the figure of merit of the total."""
    return 1.0 / (result.relative_error**2 * result.cpu_seconds)


def analog_merit(depth: float) -> float:
    """Return the analog figure at 12.5 mm, from 10 cm and one pixel."""
    wide = scene_at(depth).with_(**{"receiver.aperture_radius": f"{WIDE} m", "receiver.pixels": [1, 1]})
    result = imclab.simulate(
        wide, estimator="analog", packets=ANALOG_PACKETS[depth], seed=1, threads=1, time_bins=0
    )
    return merit(result) * (NARROW / WIDE) ** 2


def main(seeds: int) -> None:
    """Print one line for each optical depth and seed, and the medians."""
    for depth in DEPTHS:
        truth = analog_merit(depth)
        ratios = []
        for seed in range(1, seeds + 1):
            result = imclab.simulate(scene_at(depth), packets=AUTO_PACKETS, seed=seed, threads=1, time_bins=0)
            relative = result.energy_stderr / result.energy
            median, rms = float(np.median(relative)), float(np.sqrt(np.mean(relative**2)))
            ratios.append(merit(result) / truth)
            print(
                f"depth {depth}: analog {truth:.3g}, auto {merit(result):.3g}, ratio {ratios[-1]:.3g}; "
                f"pixel median {100 * median:.2f} %, RMS {100 * rms:.2f} %, "
                f"CPU seconds to 1 % median pixel {result.cpu_seconds * (median / 0.01) ** 2:.2f}",
                flush=True,
            )
        print(f"depth {depth}: median ratio {np.median(ratios):.3g}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
