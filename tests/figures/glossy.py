"""Errors of the scenes with a mirror: ``python -m tests.figures.glossy [PACKETS]``.

For each shipped scene with a glossy figure, at optical depths 0.42 and 1.42: figure of merit of the
total, 1/(relative variance x CPU seconds), and stated relative errors of pixels on the figure and on the
ground. One thread.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import imclab
from imclab.transport.direct_light import coverage_of

SCENES = Path(__file__).parents[2] / "data" / "scenes"
NAMES = ("double_slit", "diver", "nickel_slit")


def main(packets: float) -> None:
    """Print one row of a table for each scene, depth and estimator."""
    print(
        "| scene | optical depth | estimator | CPU s | merit of the total | figure, median / RMS | ground |"
    )
    print("|---|---|---|---|---|---|---|")
    for name in NAMES:
        for depth in (0.42, 1.42):
            scene = imclab.load_scene(SCENES / f"{name}.toml")
            scene = scene.with_(**{"medium.attenuation": f"{depth} 1/m"})
            for estimator in ("expected", "two-sided"):
                result = imclab.simulate(
                    scene, estimator=estimator, packets=packets, seed=1, threads=1, time_bins=0
                )
                merit = 1.0 / (result.relative_error**2 * result.cpu_seconds)
                figure = (
                    coverage_of(np.asarray(scene.figure_mask, dtype=np.uint8), *result.energy.shape) > 0.5
                )
                relative = result.energy_stderr / np.where(result.energy > 0.0, result.energy, np.inf)
                parts = [
                    f"{100 * np.median(part):.1f} / {100 * np.sqrt(np.mean(part**2)):.0f} %"
                    for part in (relative[figure], relative[~figure])
                ]
                print(
                    f"| {name} | {depth} | {estimator} | {result.cpu_seconds:.1f} | {merit:.2g} | {parts[0]} "
                    f"| {parts[1]} |",
                    flush=True,
                )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 3e5)
