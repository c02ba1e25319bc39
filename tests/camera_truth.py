"""A synthetic intensified camera whose truth is known: frames for tests, all of it SYNTHETIC.

Written without a look at the fit: photoelectrons are counted (Poisson), multiplied (gamma: excess
noise), spread (Gaussian on the pixels), turned into sensor electrons with their own shot noise,
bent by one of several response families, and digitised.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tifffile
from scipy import ndimage

PHOTON = 6.62607015e-34 * 299792458.0 / 532e-9

# Response families: drive (1 at nominal full drive) -> share of full scale.
FAMILIES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "linear": lambda u: u,
    "gamma 0.5": np.sqrt,
    "gamma 2": lambda u: u**2,
    "S": lambda u: 1.1 * u**1.4 / (u**1.4 + 0.35**1.4),
    "knee": lambda u: 1.4 * u - 0.9 * 0.05 * np.logaddexp(0.0, (u - 0.55) / 0.05),
    "soft": lambda u: 1.06 * (1.0 - np.exp(-2.6 * u)),
}


@dataclass(frozen=True)
class TrueCamera:
    """The truth. ``drive_per_event`` is the drive of one photoelectron at relative gain 1."""

    family: str = "linear"
    bit_depth: int = 12
    shape: tuple[int, int] = (64, 64)
    efficiency: float = 0.2
    excess: float = 1.6
    spread: float = 0.0
    drive_per_event: float = 5e-4
    read_noise: float = 2.0
    offset: float = 60.0
    sensor_events: float = 0.0  # sensor electrons per photoelectron at gain 1; 0: noiseless sensor
    nonuniformity: float = 0.02
    gains: dict[float, float] = field(default_factory=lambda: {700.0: 1.0})
    hot: int = 6
    dead: int = 5
    blinking: int = 4
    seed: int = 1

    @property
    def full_scale(self) -> int:
        return 2**self.bit_depth - 1

    @property
    def gray_offset(self) -> float:
        """Dark level in counts; scaled down for few bits."""
        return min(self.offset, 0.04 * self.full_scale + 4.0)

    @property
    def maps(self) -> dict[str, np.ndarray]:
        rng = np.random.default_rng(self.seed + 90_000)
        count = self.shape[0] * self.shape[1]
        rows, columns = np.indices(self.shape)
        radius = np.hypot(rows / self.shape[0] - 0.5, columns / self.shape[1] - 0.5)
        flat = (1.0 - 0.15 * radius**2) * (1.0 + self.nonuniformity * rng.standard_normal(self.shape))
        chosen = rng.choice(count, self.hot + self.dead + self.blinking, replace=False)
        hot = np.zeros(count, bool)
        dead = np.zeros(count, bool)
        blinking = np.zeros(count, bool)
        hot[chosen[: self.hot]] = True
        dead[chosen[self.hot : self.hot + self.dead]] = True
        blinking[chosen[self.hot + self.dead :]] = True
        pattern = 0.5 * rng.standard_normal(self.shape)
        return {
            "flat": flat / np.median(flat),
            "pattern": pattern,
            "hot": hot.reshape(self.shape),
            "dead": dead.reshape(self.shape),
            "blinking": blinking.reshape(self.shape),
        }

    def response(self, drive: np.ndarray) -> np.ndarray:
        """Counts above dark at a drive, without noise."""
        return np.asarray(FAMILIES[self.family](np.asarray(drive, float))) * (
            self.full_scale - self.gray_offset
        )

    def drive(self, energy: np.ndarray, gain: float) -> np.ndarray:
        return np.asarray(energy) / PHOTON * self.efficiency * self.drive_per_event * self.gains[gain]

    def energy_at(self, counts_above: np.ndarray, gain: float) -> np.ndarray:
        """Energy whose noiseless answer is so many counts above dark (by table)."""
        drive = np.geomspace(1e-6, 3.0, 200_000)
        counts = self.response(drive)
        rising = np.maximum.accumulate(counts)
        at = np.interp(counts_above, rising, drive)
        return at / (self.drive(np.array(1.0), gain))

    def events_per_energy(self) -> float:
        return self.efficiency / PHOTON

    def frame(self, energy: float | np.ndarray, gain: float, rng: np.random.Generator) -> np.ndarray:
        """One frame of raw counts at an energy per pixel (before the pixels' own sensitivity)."""
        maps = self.maps
        sensitivity = np.where(maps["dead"], 0.05, maps["flat"])
        mean = np.broadcast_to(np.asarray(energy, float), self.shape) * self.events_per_energy()
        if self.spread > 0.0:
            pad = 6
            mean = np.pad(mean, pad, mode="edge")
        events = rng.poisson(mean).astype(float)
        if self.excess > 1.0:
            each = 1.0 / (self.excess - 1.0)
            events = np.where(events > 0, rng.gamma(np.maximum(events, 1e-9) * each) / each, 0.0)
        if self.spread > 0.0:
            events = ndimage.gaussian_filter(events, self.spread, truncate=6.0)[pad:-pad, pad:-pad]
        multiplied = events * self.gains[gain]
        if self.sensor_events > 0.0:
            multiplied = rng.poisson(np.maximum(multiplied, 0.0) * self.sensor_events) / self.sensor_events
        counts = self.response(multiplied * self.drive_per_event * sensitivity)
        raw = counts + self.gray_offset + maps["pattern"] + self.read_noise * rng.standard_normal(self.shape)
        raw = raw + maps["hot"] * 0.15 * self.full_scale
        raw = raw + maps["blinking"] * (rng.random(self.shape) < 0.5) * max(25.0 * self.read_noise, 12.0)
        return np.clip(np.rint(raw), 0, self.full_scale).astype(
            np.uint8 if self.bit_depth == 8 else np.uint16
        )


@dataclass(frozen=True)
class Plan:
    """How the synthetic camera is calibrated: levels per setting as shares of full scale."""

    levels: int = 16
    low: float = 0.02
    high: float = 0.93
    frames: int = 4
    dark_frames: int = 16
    flat_frames: int = 16
    source_error: float = 0.0
    run_error: float = 0.0
    stated_error: bool = False
    relative: bool = False


def write_folder(camera: TrueCamera, folder: Path, plan: Plan, *, seed: int) -> Path:
    """Write a whole synthetic calibration folder; all settings share the nominal light levels."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    rows: list[list[object]] = []

    def write(kind: str, energy: float | None, true_energy: float, gain: float, count: int) -> None:
        name = f"{kind}_{len(rows):03d}.tif"
        stack = np.stack([camera.frame(true_energy, gain, rng) for _ in range(count)])
        tifffile.imwrite(folder / name, stack, photometric="minisblack")
        rows.append([name, kind, "" if energy is None else repr(float(energy)), gain, 3])

    reference = next(iter(camera.gains))
    shares = np.geomspace(plan.low, plan.high, plan.levels)
    if plan.levels > 20:
        shares = np.sort(
            np.concatenate([shares[::2], np.linspace(plan.low, plan.high, plan.levels // 2 + 2)[1:-1]])
        )
    span = camera.full_scale - camera.gray_offset
    unit = 1.0 if not plan.relative else 1.0 / camera.energy_at(np.array(0.5 * span), reference)
    errors: dict[float, float] = {}
    for gain in camera.gains:
        write("dark", None, 0.0, gain, plan.dark_frames)
        write("flat", None, float(camera.energy_at(np.array(0.5 * span), gain)), gain, plan.flat_frames)
    base = camera.energy_at(shares * span, reference)
    ladder = ladder_of(camera, base)
    for gain in camera.gains:
        kind = "response" if gain == reference else "gain"
        for energy in ladder:
            expected = float(camera.response(camera.drive(np.array(energy), gain))) / span
            if not plan.low * 0.98 <= expected <= plan.high * 1.01:
                continue
            error = errors.setdefault(float(energy), plan.source_error * rng.standard_normal())
            true = energy * np.exp(error + plan.run_error * rng.standard_normal())
            write(kind, float(energy) * unit, true, gain, plan.frames)
    with (folder / "frames.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["file", "kind", "energy_rel" if plan.relative else "energy_J", "gain", "gate_ns"])
        writer.writerows(rows)
    lines = [f"bit_depth = {camera.bit_depth}", 'wavelength = "532 nm"', 'name = "synthetic camera"']
    lines.append(f"reference_gain = {reference}")
    if plan.stated_error:
        lines.append(f"energy_stderr = {plan.source_error}")
    (folder / "camera.toml").write_text("\n".join(lines) + "\n")
    return folder


def ladder_of(camera: TrueCamera, base: np.ndarray) -> np.ndarray:
    """Energies of the reference setting, carried on downwards by the same steps for higher gains."""
    if len(camera.gains) == 1:
        return base
    largest = max(camera.gains.values())
    step = float(np.median(base[1:] / base[:-1]))
    count = int(np.ceil(np.log(largest) / np.log(step)))
    return np.concatenate([base[0] * step ** -np.arange(count, 0, -1.0), base])
