"""Pictures made without a simulation, for tests of what comes after one. Synthetic, like all in tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from imclab.result import Result
from imclab.scene import Scene


def picture_of(scene: Scene, *, seed: int = 1, relative_noise: float = 0.002, **_: Any) -> Result:
    """Return the target lit evenly and dimmed by Beer's law on both ways, with a little noise."""
    columns, rows = scene.receiver.pixels
    mask = scene.figure_mask
    row = ((np.arange(rows) + 0.5) / rows * mask.shape[0]).astype(int)
    column = ((np.arange(columns) + 0.5) / columns * mask.shape[1]).astype(int)
    reflectance = np.where(mask[np.ix_(row, column)], 0.9, 0.1)
    depth = (scene.medium.attenuation or 0.0) * scene.target.distance
    energy = 2e-11 / (rows * columns) * reflectance * np.exp(-2 * depth)
    noise = relative_noise * energy
    energy = energy + noise * np.random.default_rng(seed).standard_normal(energy.shape)
    total = float(energy.sum())
    nothing = np.zeros_like(energy)
    return Result(
        energy=energy,
        energy_stderr=noise,
        target=energy,
        target_stderr=noise,
        backscatter=nothing,
        backscatter_stderr=nothing,
        total=total,
        total_stderr=float(np.sqrt((noise**2).sum())),
        target_total=total,
        target_total_stderr=float(np.sqrt((noise**2).sum())),
        backscatter_total=0.0,
        backscatter_total_stderr=0.0,
        scene=scene.toml,
        estimator="none",
        seed=seed,
        packets=1,
        cpu_seconds=0.0,
        wall_seconds=0.0,
    )
