"""Time and memory of calibrating 500 frames of 1024 x 1024, 16 bit, beside plain reading.

    python -m tests.figures.calibration_speed [--folder DIR]

The frames are synthetic and drawn fast (Gaussian noise): this measures speed, not accuracy.
"""

from __future__ import annotations

import argparse
import csv
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import tifffile

SHAPE = (1024, 1024)
GAINS = {700: 1.0, 750: 3.0, 800: 9.0}


def write(folder: Path) -> int:
    """Write the folder: dark, flat and 16 levels at three settings."""
    rng = np.random.default_rng(5)
    noise = [rng.standard_normal(SHAPE, dtype=np.float32) for _ in range(7)]
    rows: list[list[object]] = []

    def stack(kind: str, level: float, gain: int, count: int) -> None:
        name = f"{kind}_{len(rows):03d}.tif"
        spread = np.float32(np.sqrt(400.0 + 8.0 * level))
        with tifffile.TiffWriter(folder / name) as tiff:
            for _ in range(count):
                shift = rng.integers(0, 1024, 2)
                drawn = np.roll(noise[rng.integers(7)], tuple(shift), axis=(0, 1))
                picture = np.clip(500.0 + level + spread * drawn, 0, 65535).astype(np.uint16)
                tiff.write(picture, photometric="minisblack", contiguous=True)
        rows.append([name, kind, "" if kind in ("dark", "flat") else level / GAINS[gain] * 1e-18, gain, 3])

    for gain in GAINS:
        stack("dark", 0.0, gain, 20)
        stack("flat", 30000.0, gain, 20)
        for level in np.geomspace(900.0, 58000.0, 16):
            stack("response" if gain == 700 else "gain", float(level), gain, 8)
    with (folder / "frames.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["file", "kind", "energy_J", "gain", "gate_ns"], *rows])
    (folder / "camera.toml").write_text('bit_depth = 16\nwavelength = "532 nm"\n')
    return 3 * (20 + 20 + 16 * 8)


def main() -> None:
    """Write, read plainly, calibrate in a process of its own, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = chosen.folder or Path(temporary)
        folder.mkdir(exist_ok=True)
        frames = write(folder)
        started, cpu = time.perf_counter(), time.process_time()
        for path in sorted(folder.glob("*.tif")):
            tifffile.imread(path)
        reading, reading_cpu = time.perf_counter() - started, time.process_time() - cpu
        code = f"import calibration; calibration.calibrate({str(folder)!r})"
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        started = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        wall = time.perf_counter() - started
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime
    sys.stdout.write(f"{frames} frames of {SHAPE[0]} x {SHAPE[1]}, 16 bit\n")
    for name, clock, cpu in (("plain reading", reading, reading_cpu), ("calibration", wall, seconds)):
        sys.stdout.write(
            f"{name:14s}{clock:7.1f} s wall{cpu:7.1f} s CPU{1e3 * cpu / frames:7.1f} ms a frame\n"
        )
    sys.stdout.write(f"peak memory {used.ru_maxrss / 1024:.0f} MB\n")


if __name__ == "__main__":
    main()
