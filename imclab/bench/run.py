"""The bench itself: validate, measure, combine."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from imclab.bench.measure import FEWEST_ARRIVALS_ERROR, Run, measured, summary
from imclab.bench.scenes import target_scene, with_optical_depth
from imclab.bench.validate import Check, WrongKernelError, forward_checks, refuse_wrong
from imclab.errors import InputError
from imclab.provenance import machine, versions
from imclab.result import Result
from imclab.scene import Scene
from imclab.transport import simulate, transmit

ESTIMATORS = ("analog", "expected", "two-sided", "auto")
_LADDER = (0.25, 0.5, 1.0)

__all__ = ["Bench", "BenchOptions", "WrongKernelError", "bench", "standard_scenes"]


@dataclass(frozen=True, kw_only=True)
class BenchOptions:
    """How much is measured: seconds of the longest run, of the reference, how many seeds, and where.

    ``optical_depths`` and ``pixels`` (a side of the picture) are those of the cost tables.
    """

    seconds: float = 2.0
    reference_seconds: float = 20.0
    seeds: int = 3
    seed: int = 1
    optical_depths: tuple[float, ...] = (0.1, 0.42, 1.42, 4.0, 10.0)
    pixels: tuple[int, ...] = (50, 100, 200, 400, 800)


@dataclass(frozen=True, kw_only=True)
class Bench:
    """All that was measured; ``runs`` one by one, ``estimators`` combined."""

    checks: list[Check]
    runs: list[Run]
    estimators: list[dict[str, Any]]
    forward: list[dict[str, float]]
    threads: list[dict[str, float]]
    optical_depths: list[dict[str, float]]
    pixels: list[dict[str, float]]
    options: BenchOptions
    machine: str = field(default_factory=machine)
    versions: dict[str, str] = field(default_factory=versions)

    def document(self) -> dict[str, Any]:
        """Return everything as what JSON can hold."""
        return asdict(self)


def standard_scenes() -> dict[str, Scene]:
    """Return a Lambertian target behind three waters."""
    return {f"optical depth {c:g}": with_optical_depth(target_scene(), c) for c in (0.42, 1.42, 4.0)}


def bench(
    scenes: Mapping[str, Scene],
    options: BenchOptions,
    *,
    progress: Callable[[str], None] = lambda text: None,
) -> Bench:
    """Measure every estimator on every scene.

    Parameters
    ----------
    scenes : mapping of str to Scene
    options : BenchOptions
    progress : callable
        Told in words what is being measured.

    Raises
    ------
    WrongKernelError
        When the forward engine or an estimator is wrong; nothing of it has been timed then.
    """
    progress("validating the forward engine")
    checks = forward_checks(options.seed)
    refuse_wrong(checks)
    runs: list[Run] = []
    for name, scene in scenes.items():
        progress(f"{name}: reference")
        reference = simulate(
            scene, estimator="auto", seconds=options.reference_seconds, seed=options.seed + 1000, time_bins=0
        )
        for estimator in ESTIMATORS:
            progress(f"{name}: {estimator}")
            runs += _ladder(name, scene, reference, estimator=estimator, options=options, checks=checks)
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.scene, run.estimator), []).append(run)
    base = next(iter(scenes.values()))
    progress("cost against optical depth, pixels and threads")
    return Bench(
        checks=checks,
        runs=runs,
        estimators=[summary(group) for group in groups.values()],
        forward=_forward(base, options),
        threads=_threads(base, options),
        optical_depths=_depths(base, options),
        pixels=[_cost(_with_pixels(base, n), options) | {"pixels": float(n)} for n in options.pixels],
        options=options,
    )


def _rate(scene: Scene, estimator: str, options: BenchOptions) -> float:
    """Return packets per CPU second from a short run, which also compiles the kernels."""
    pilot = simulate(
        scene, estimator=estimator, seconds=0.1 * options.seconds, seed=options.seed, threads=1, time_bins=0
    )
    return pilot.packets / pilot.cpu_seconds


def _ladder(
    name: str,
    scene: Scene,
    reference: Result,
    *,
    estimator: str,
    options: BenchOptions,
    checks: list[Check],
) -> list[Run]:
    """Run an estimator for rising times and several seeds, the first run being its validation."""
    try:
        rate = _rate(scene, estimator, options)
    except InputError:
        return []  # an estimator that does not take this scene
    runs: list[Run] = []
    for k in range(options.seeds):
        for step, part in enumerate(_LADDER):
            seed = options.seed + len(_LADDER) * k + step
            packets = max(32.0, rate * part * options.seconds)
            runs.append(measured(name, scene, reference, estimator=estimator, packets=packets, seed=seed))
        if k == 0:
            known = [run for run in runs if run.own_error <= FEWEST_ARRIVALS_ERROR]
            found = [Check(f"{name}, {estimator}, total", run.z_total) for run in known]
            refuse_wrong(found)
            checks += found
    return runs


def _forward(scene: Scene, options: BenchOptions) -> list[dict[str, float]]:
    """Packets per CPU second of the forward engine, and of the scalar analog kernel in double precision."""
    rows: list[dict[str, float]] = []
    seconds, seed = 0.5 * options.seconds, options.seed
    for depth in (0.42, 1.42, 10.0):
        try:
            water = with_optical_depth(scene, depth)
        except InputError:
            return rows
        flux = transmit(water, seconds=seconds, seed=seed, threads=1)
        analog = simulate(water, estimator="analog", seconds=seconds, seed=seed, threads=1, time_bins=0)
        rows.append(
            {
                "optical_depth": depth,
                "lanes_float32_packets_per_cpu_second": flux.packets / flux.cpu_seconds,
                "analog_float64_packets_per_cpu_second": analog.packets / analog.cpu_seconds,
            }
        )
    return rows


def _threads(scene: Scene, options: BenchOptions) -> list[dict[str, float]]:
    """Packets per second of wall clock with one and two threads."""
    rows = []
    for threads in (1, 2):
        flux = transmit(scene, seconds=0.5 * options.seconds, seed=options.seed, threads=threads)
        result = simulate(
            scene, seconds=0.5 * options.seconds, seed=options.seed, threads=threads, time_bins=0
        )
        rows.append(
            {
                "threads": float(threads),
                "transmit_packets_per_second": flux.packets / flux.wall_seconds,
                "simulate_packets_per_second": result.packets / result.wall_seconds,
            }
        )
    return rows


def _depths(scene: Scene, options: BenchOptions) -> list[dict[str, float]]:
    rows = []
    for depth in options.optical_depths:
        try:
            rows.append(_cost(with_optical_depth(scene, depth), options) | {"optical_depth": depth})
        except InputError:
            return []
    return rows


def _with_pixels(scene: Scene, count: int) -> Scene:
    return scene.with_(**{"receiver.pixels": [count, count]})


def _cost(scene: Scene, options: BenchOptions) -> dict[str, float]:
    """CPU seconds to 1 % of total and median pixel, by ``auto``."""
    packets = max(32.0, _rate(scene, "auto", options) * 0.5 * options.seconds)
    result = simulate(scene, estimator="auto", packets=packets, seed=options.seed, threads=1, time_bins=0)
    run = measured("", scene, result, estimator="auto", packets=packets, seed=options.seed + 1)
    return {
        "total_cpu_seconds_to_1_percent": _to_one_percent(run.total_stated, run.cpu_seconds),
        "median_pixel_cpu_seconds_to_1_percent": _to_one_percent(run.median_pixel_stated, run.cpu_seconds),
    }


def _to_one_percent(error: float, seconds: float) -> float:
    return seconds * (error / 0.01) ** 2 if math.isfinite(error) else math.nan
