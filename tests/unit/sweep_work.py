"""Stand-ins for a simulation, importable by worker processes: quick, deterministic, or failing on purpose."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np

from imclab.result import Flux, Result
from imclab.scene import Scene
from imclab.sweep import Unit

DOCUMENT = {
    "schema": 1,
    "medium": {
        "attenuation": "0.42 1/m",
        "albedo": 0.89,
        "refractive_index": 1.34,
        "phase_function": {"kind": "henyey-greenstein", "g": 0.924},
    },
    "laser": {
        "wavelength": "532 nm",
        "pulse_energy": "20 uJ",
        "pulse_fwhm": "4.5 ns",
        "divergence_fwhm": "200 mrad",
        "spot_fwhm": "1 mm",
    },
    "target": {
        "distance": "1 m",
        "width": "5 cm",
        "height": "5 cm",
        "figure": {"kind": "lambertian", "reflectance": 0.5},
    },
    "receiver": {"aperture_radius": "12.5 mm", "pixels": [3, 2]},
    "run": {"packets": 1000},
}


def scene() -> Scene:
    return Scene.from_document(DOCUMENT)


def result_of(unit: Unit, threads: int | None) -> Result:
    """A picture that follows from the scene alone, as a simulation's does from scene and seed."""
    seed = unit.scene.run.seed
    attenuation = unit.scene.medium.attenuation or 0.0
    picture = np.random.default_rng(seed).random((2, 3)) * np.exp(-2 * attenuation)
    parts = {
        name: picture * share for name, share in (("energy", 1.0), ("target", 0.9), ("backscatter", 0.1))
    }
    return Result(
        **parts,
        **{f"{name}_stderr": 0.01 * part for name, part in parts.items()},
        total=float(picture.sum()),
        total_stderr=0.01,
        target_total=0.9,
        target_total_stderr=0.01,
        backscatter_total=0.1,
        backscatter_total_stderr=0.01,
        scene=unit.scene.toml,
        estimator="made up",
        seed=seed,
        packets=1000,
        cpu_seconds=time.process_time(),
        wall_seconds=0.0,
        threads=threads or 1,
    )


def flux_of(unit: Unit, threads: int | None) -> Flux:
    assert unit.one_way is not None
    distances = np.array(unit.one_way.distances)
    share = np.exp(-(unit.scene.medium.attenuation or 0.0) * distances)
    names = ("transmitted", "reflected", "spot_fwhm", "spot_rms", "pulse_fwhm", "pulse_rms")
    names += ("mean_path", "reflected_mean_path")
    columns = {key: share for name in names for key in (name, f"{name}_stderr")}
    return Flux(
        distances=distances,
        **columns,
        absorbed=0.1,
        absorbed_stderr=0.01,
        scene=unit.scene.toml,
        seed=1,
        packets=1000,
        cpu_seconds=0.0,
        wall_seconds=0.0,
    )


def slow_result_of(unit: Unit, threads: int | None) -> Result:
    time.sleep(0.1)
    return result_of(unit, threads)


def fails_on_odd_seeds(unit: Unit, threads: int | None) -> Result:
    if unit.scene.run.seed % 2:
        raise ArithmeticError(f"seed {unit.scene.run.seed} is odd")
    return result_of(unit, threads)


def dies_on_seed_3(unit: Unit, threads: int | None) -> Result:
    if unit.scene.run.seed == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return result_of(unit, threads)


def dies_once_on_seed_3(unit: Unit, threads: int | None) -> Result:
    marker = Path(os.environ["SWEEP_WORK_MARKER"])
    if unit.scene.run.seed == 3 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return result_of(unit, threads)


def interrupts_on_seed_3(unit: Unit, threads: int | None) -> Result:
    if unit.scene.run.seed == 3:
        raise KeyboardInterrupt
    return result_of(unit, threads)


def forbidden(unit: Unit, threads: int | None) -> Result:
    raise AssertionError("nothing was left to do")
