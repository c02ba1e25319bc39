"""Accuracy of the camera calibration and truth of its stated errors, on synthetic stacks.

    python -m tests.figures.calibration [--seeds 20] [--case NAME]

Every case is a synthetic camera with a known truth (``tests/camera_truth.py``: other code, other
response families than the fit). Printed per case: the worst and the median over seeds of each
error, and how often the stated 95 % interval holds the truth.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import calibration
from tests.camera_truth import Plan, TrueCamera, write_folder

THREE = {700.0: 1.0, 750.0: 3.0, 800.0: 9.0}
CAMERAS = {
    "linear 12 bit": TrueCamera(gains=THREE),
    "linear 16 bit": TrueCamera(gains=THREE, bit_depth=16, read_noise=20.0, offset=500.0),
    "S 12 bit": TrueCamera(family="S", gains=THREE),
    "S 8 bit": TrueCamera(family="S", gains=THREE, bit_depth=8, read_noise=1.0, drive_per_event=1e-3),
    "gamma 0.5, 10 bit": TrueCamera(family="gamma 0.5", gains=THREE, bit_depth=10, drive_per_event=1e-5),
    "gamma 2, 12 bit": TrueCamera(family="gamma 2", gains=THREE, drive_per_event=1e-4),
    "knee 12 bit": TrueCamera(family="knee", gains=THREE),
    "knee 16 bit, spread 1 px": TrueCamera(
        family="knee", gains=THREE, bit_depth=16, read_noise=20.0, offset=500.0, spread=1.0
    ),
    "soft 10 bit, spread 0.6 px": TrueCamera(family="soft", gains=THREE, bit_depth=10, spread=0.6),
}


@dataclass
class Score:
    """Errors and stated errors of one quantity over seeds."""

    error: list[float] = field(default_factory=list)
    held: list[float] = field(default_factory=list)
    normal: list[float] = field(default_factory=list)

    def add(self, value: float, truth: float, stderr: float) -> None:
        """Take in one value; ``stderr`` absolute."""
        self.error.append(abs(value / truth - 1.0))
        self.held.append(float(abs(value - truth) <= 1.96 * stderr))
        self.normal.append((value - truth) / stderr)


def figure(camera: calibration.Calibration, name: str, gain: float | None = None) -> calibration.Figure:
    """Find a figure of merit by the start of its name."""
    return next(
        item
        for item in camera.figures
        if item.name.startswith(name) and (gain is None or item.setting == gain)
    )


def true_conversion(truth: TrueCamera, camera: calibration.Calibration, gain: float) -> float:
    """Counts per naive event at the middle of the range, from the truth alone.

    One pixel's variance is excess * sum(psf^2) per event; K is the slope of the counts over such events.
    """
    middle = 0.5 * (camera.response.lowest + camera.response.highest)
    energy = float(truth.energy_at(np.array(middle), gain))
    step = 1e-4
    slope = float(
        truth.response(truth.drive(np.array(energy * (1 + step)), gain))
        - truth.response(truth.drive(np.array(energy * (1 - step)), gain))
    ) / (2 * step * energy)
    per_event = 1.0 / truth.events_per_energy()
    return slope * per_event * truth.excess * pixel_share(truth.spread)


def pixel_share(spread: float) -> float:
    """Sum of squares of the event's spread over pixels."""
    if spread == 0.0:
        return 1.0
    at = np.arange(-8, 9)
    line = np.exp(-0.5 * (at / spread) ** 2)
    line /= line.sum()
    return float((line**2).sum() ** 2)


def score_case(truth: TrueCamera, plan: Plan, seeds: int) -> dict[str, Score]:
    """Calibrate the same camera ``seeds`` times and score everything."""
    scores: dict[str, Score] = {}
    for seed in range(seeds):
        with tempfile.TemporaryDirectory() as folder:
            camera = calibration.calibrate(write_folder(truth, Path(folder) / "frames", plan, seed=seed))
        score_one(truth, camera, scores)
    return scores


def score_one(truth: TrueCamera, camera: calibration.Calibration, scores: dict[str, Score]) -> None:
    """Score one calibration against the truth."""
    reference = camera.reference_gain
    low, high = camera.response.lowest, camera.response.highest
    counts = np.linspace(low + 0.05 * (high - low), high - 0.05 * (high - low), 40)
    flat = camera.setting(reference).flat
    quarter, three_quarters = np.quantile(flat[~camera.bad_pixels], [0.25, 0.75])
    typical = ~camera.bad_pixels & (flat >= quarter) & (flat <= three_quarters)
    # The truth's maps are scaled to their own median; the response is that of the typical pixels.
    energy = truth.energy_at(counts, reference) / float(truth.maps["flat"][typical].mean())
    measured = camera.response.exposure(counts)
    response = scores.setdefault("response", Score())
    for value, true in zip(measured, energy, strict=True):
        response.add(float(value), float(true), true * camera.systematic(float(true), gain=reference))
    for gain in truth.gains:
        if gain != reference:
            value, stderr = camera.relative_gain(gain)
            scores.setdefault("gain ratio", Score()).add(value, truth.gains[gain], stderr)
        found = figure(camera, "conversion gain", gain)
        scores.setdefault("conversion gain", Score()).add(
            found.value, true_conversion(truth, camera, gain), float(np.hypot(found.stderr, found.systematic))
        )
        found = figure(camera, "read noise", gain)
        scores.setdefault("read noise", Score()).add(found.value, truth.read_noise, found.stderr)
    found = figure(camera, "QE/F²")
    scores.setdefault("QE/F²", Score()).add(
        found.value, truth.efficiency / truth.excess, float(np.hypot(found.stderr, found.systematic))
    )
    maps = truth.maps
    bad = maps["hot"] | maps["dead"] | maps["blinking"]
    missed = int((bad & ~camera.bad_pixels).sum())
    false = int((camera.bad_pixels & ~bad).sum())
    scores.setdefault("bad pixels missed", Score()).error.append(missed / bad.sum())
    scores.setdefault("false alarms", Score()).error.append(false / bad.size)


def main() -> None:
    """Measure every case and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--case", default="")
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--levels", type=int, default=40)
    parser.add_argument("--source-error", type=float, default=0.0)
    chosen = parser.parse_args()
    plan = Plan(levels=chosen.levels, frames=6, dark_frames=24, source_error=chosen.source_error)
    pooled: dict[str, Score] = {}
    for name, camera in CAMERAS.items():
        if chosen.case not in name:
            continue
        started = time.process_time()
        truth = replace(camera, shape=(chosen.size, chosen.size))
        scores = score_case(truth, plan, chosen.seeds)
        sys.stdout.write(f"{name} ({chosen.seeds} seeds, {time.process_time() - started:.0f} s CPU)\n")
        for quantity, score in scores.items():
            _print(quantity, score)
            pooled.setdefault(quantity, Score()).error.extend(score.error)
            pooled[quantity].held.extend(score.held)
            pooled[quantity].normal.extend(score.normal)
        sys.stdout.flush()
    sys.stdout.write("all cases\n")
    for quantity, score in pooled.items():
        _print(quantity, score)


def _print(quantity: str, score: Score) -> None:
    error = 100.0 * np.array(score.error)
    held = ""
    if score.held:
        size = np.sqrt(np.mean(np.square(score.normal)))
        held = f"  95 % interval holds {100 * np.mean(score.held):5.1f} %  error/stated {size:.2f} rms"
    sys.stdout.write(
        f"  {quantity:20s} median {np.median(error):8.4f} %  p95 {np.quantile(error, 0.95):8.4f} %  "
        f"max {error.max():8.4f} %{held}\n"
    )


if __name__ == "__main__":
    main()
