"""The calibration against a camera simulator that nobody here wrote (getframes 2.6, MIT).

    python -m pip install getframes==2.6.1        # not a dependency of this project
    python -m tests.figures.calibration_getframes

An electron-multiplying CCD stands in for the intensifier: stochastic gain with excess noise,
non-linearity, at three gains.
"""

from __future__ import annotations

import csv
import sys
import tempfile
from pathlib import Path

import getframes
import numpy as np
import tifffile

import calibration

PHOTON = 6.62607015e-34 * 299792458.0 / 532e-9
SHAPE = (128, 128)
EFFICIENCY = 0.9
SETTINGS = {10.0: 10.0, 30.0: 30.0, 90.0: 90.0}


def camera_at(gain: float, *, nonlinearity: float) -> getframes.Camera:
    """One synthetic EMCCD."""
    config = getframes.CameraConfig(
        name="synthetic EMCCD",
        sensor_type=getframes.SensorType.EMCCD,
        resolution=SHAPE,
        pixel_size_um=13.0,
        quantum_efficiency=EFFICIENCY,
        full_well_e=6e5,
        output_full_well_e=6e5,
        bit_depth=16,
        gain_e_per_adu=8.0,
        bias_offset_adu=400.0,
        read_noise_e=60.0,
        dark_current_e_per_s=0.0,
        em_gain=gain,
        prnu=0.01,
        nonlinearity=nonlinearity,
    )
    return getframes.Camera(config, seed=1)


def write(folder: Path, *, nonlinearity: float) -> dict[float, float]:
    """Write the folder; give the true excess noise factor squared at each gain, from the electrons."""
    rows: list[list[object]] = []
    seed = 0
    for setting, gain in SETTINGS.items():
        camera = camera_at(gain, nonlinearity=nonlinearity)
        top = 3.4e5 / (gain * EFFICIENCY)
        runs = [("dark", 0.0, 16), ("flat", 0.5 * top, 16)]
        runs += [
            ("response" if gain == 10.0 else "gain", float(light), 6)
            for light in top * np.geomspace(0.02, 1, 16)
        ]
        for kind, photons, count in runs:
            stack = []
            for _ in range(count):
                seed += 1
                stack.append(np.asarray(camera.expose(photons, 1.0, seed=seed, include_truth=False).data))
            name = f"{kind}_{len(rows):03d}.tif"
            tifffile.imwrite(folder / name, np.stack(stack).astype(np.uint16), photometric="minisblack")
            rows.append([name, kind, photons * PHOTON if kind in ("response", "gain") else "", setting, 3])
    with (folder / "frames.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["file", "kind", "energy_J", "gain", "gate_ns"], *rows])
    (folder / "camera.toml").write_text('bit_depth = 16\nwavelength = "532 nm"\nreference_gain = 10\n')


def main() -> None:
    """Calibrate and print beside the simulator's truth."""
    for nonlinearity in (0.0, 0.03):
        with tempfile.TemporaryDirectory() as temporary:
            write(Path(temporary), nonlinearity=nonlinearity)
            camera = calibration.calibrate(temporary)
        sys.stdout.write(f"non-linearity {nonlinearity:.0%}\n")
        for setting in camera.gains[1:]:
            value, stderr = camera.relative_gain(setting)
            sys.stdout.write(f"  gain {setting:g}/10: {value:.4f} ± {stderr:.4f} (truth {setting / 10:g})\n")
        for figure in camera.figures:
            if figure.name.startswith(("QE/F²", "linearity")) or (
                figure.name.startswith(("read noise", "conversion", "noise spread"))
                and figure.setting == 90.0
            ):
                sys.stdout.write(f"  {figure.name}: {figure.value:.4f} ± {figure.stderr:.4f} {figure.unit}\n")
        sys.stdout.write(f"  truth: QE/F² {EFFICIENCY / 2:.3f} with F² = 2 - 1/G, read noise {60 / 8} DN\n")


if __name__ == "__main__":
    main()
