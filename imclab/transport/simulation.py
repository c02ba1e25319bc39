"""`simulate`: choose an estimator, run it until the wanted error, and hand over a `Result`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imclab.errors import Fault, InputError
from imclab.provenance import versions
from imclab.result import Result
from imclab.scene import Scene

if TYPE_CHECKING:
    from imclab.transport.runner import Estimator, Reached, Tally
    from imclab.transport.setup import Setup

DEFAULT_TIME_BINS = 64
MOST_TIME_BINS = 1000

FloatArray = NDArray[np.float64]


def simulate(
    scene: Scene,
    *,
    rel_error: float | None = None,
    seconds: float | None = None,
    packets: float | None = None,
    pixel_error: float | None = None,
    seed: int | None = None,
    estimator: str | None = None,
    threads: int | None = None,
    time_bins: int = DEFAULT_TIME_BINS,
    progress: Callable[[Reached], None] | None = None,
) -> Result:
    """Return the picture of a scene with the standard error of every pixel.

    What is not given is taken from the scene's ``[run]``, and without it ``rel_error`` is 0.01 and
    ``seed`` 1. The run stops at the first of the limits given.

    Parameters
    ----------
    scene : Scene
    rel_error : float, optional
        Wanted relative standard error of the picture's total energy.
    seconds : float, optional
        Wall-clock time to run for, compiling not counted.
    packets : float, optional
        Number of packets; their errors and the picture are then the same for any number of threads.
    seed : int, optional
        The random numbers follow from it and from nothing else.
    pixel_error : float, optional
        Wanted relative standard error of the median pixel, instead of ``rel_error``.
    estimator : {"auto", "analog", "expected", "two-sided"}, optional
        How to estimate; ``auto`` chooses by scene and says why in ``notes``.
    threads : int, optional
        As many as the process may use when left out.
    time_bins : int
        Bins of the time histogram; 0 leaves it out. It covers the gate, or without a gate all times
        up to twice the target's return.
    progress : callable, optional
        Called with a ``Reached`` after each batch.

    Returns
    -------
    Result
        After Ctrl-C what was finished, with ``interrupted`` set.

    Raises
    ------
    InputError
        For arguments out of range and for scenes that cannot be simulated.
    """
    from imclab.transport.arrival import gate_beside_target, nothing_arrived
    from imclab.transport.estimators import choose
    from imclab.transport.request import check_threads, limits, seed_of
    from imclab.transport.runner import MeanLedger, run
    from imclab.transport.setup import setup_of
    from imclab.transport.time_histogram import time_edges

    until = limits(scene, rel_error=rel_error, seconds=seconds, packets=packets, pixel_error=pixel_error)
    used_seed = seed_of(scene, seed)
    check_threads(threads)
    if not 0 <= time_bins <= MOST_TIME_BINS:
        raise InputError("simulate", [Fault("time_bins", f"{time_bins}", f"0 to {MOST_TIME_BINS}")])
    setup = setup_of(scene, time_bins=time_bins)
    edges = time_edges(scene, setup, time_bins) if time_bins else None
    chosen = _with_totals(choose(estimator or scene.run.estimator, setup), scene, setup, edges)
    of_pixels = pixel_error is not None
    ledger = MeanLedger(chosen.exact, stop_at="energy" if of_pixels else "total", median=of_pixels)
    effort = run(chosen, ledger, until, seed=used_seed, threads=threads, progress=progress)
    joules = scene.laser.pulse_energy
    parts: dict[str, Any] = {}
    for name in ("energy", "target", "backscatter"):
        parts[name] = joules * ledger.mean(name)
        parts[f"{name}_stderr"] = joules * ledger.stderr(name)
    for name in ("total", "target_total", "backscatter_total"):
        parts[name] = float(joules * ledger.mean(name)[0])
        parts[f"{name}_stderr"] = float(joules * ledger.stderr(name)[0])
    if edges is not None:
        parts |= {"time_edges": edges, "time_energy": joules * ledger.mean("time")}
        parts["time_stderr"] = joules * ledger.stderr("time")
    return Result(
        **parts,
        scene=scene.toml,
        estimator=chosen.name,
        seed=used_seed,
        packets=effort.packets,
        cpu_seconds=effort.cpu_seconds,
        wall_seconds=effort.wall_seconds,
        threads=effort.threads,
        notes=gate_beside_target(scene, setup)
        + nothing_arrived(scene, parts["total"])
        + chosen.notes
        + effort.notes,
        interrupted=effort.interrupted,
        versions=versions(),
    )


def _with_totals(estimator: Estimator, scene: Scene, setup: Setup, edges: FloatArray | None) -> Estimator:
    """Add the whole picture, the totals and the pulse's own length to what an estimator tallies.

    They are derived batch by batch, because the errors of pixels and of time bins are correlated: that
    of a sum does not follow from those of its parts.
    """
    from imclab.transport.time_histogram import pulse_spread

    spread = None if edges is None else pulse_spread(scene, setup, edges)

    def derive(tally: Tally) -> Tally:
        target, backscatter = tally["target"], tally["backscatter"]
        whole = target + backscatter
        derived = {"target": target, "backscatter": backscatter, "energy": whole}
        for name, picture in (
            ("total", whole),
            ("target_total", target),
            ("backscatter_total", backscatter),
        ):
            derived[name] = np.array([picture.sum()])
        if spread is not None:
            derived["time"] = spread @ tally["time"]
        return derived

    def batch(seed: int, first_history: int, count: int) -> Tally:
        return derive(estimator.batch(seed, first_history, count))

    exact = derive(estimator.exact) if estimator.exact else {}
    return replace(estimator, batch=batch, exact=exact)
