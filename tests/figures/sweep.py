"""How much faster two workers finish a sweep than one: ``python -m tests.figures.sweep [TURNS [MINUTES]]``.

A local Dask cluster with one worker process and one with two, the same 24 scenes, in turns. Each turn
gives one ratio of wall times. A turn starts when other programs are quiet; one during which they took a tenth
of the processors or more is shown and not counted. Turns go on until enough are counted or the minutes are
over. Beside it stands the ratio of the processor time of the busiest worker, which other programs hardly
touch: what the wall time comes to when nothing else runs and workers never wait. The bits of all runs are
compared.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from imclab.scene import load_scene
from imclab.sweep import Axis, Unit, plan, run, with_run

SCENE = Path(__file__).parents[2] / "data/scenes/lambertian_slit.toml"
PACKETS = 4e5
TURNS = 3
MOST_BY_OTHERS = 0.1
SECONDS_OF_QUIET = 1.5


class Timed(NamedTuple):
    """Wall seconds, processor seconds of the busiest worker, others' share of the processors, bits."""

    seconds: float
    busiest: float
    others: float
    bits: bytes


def units() -> list[Unit]:
    scene = with_run(load_scene(SCENE), packets=PACKETS).with_(**{"receiver.pixels": [50, 50]})
    return plan(scene, [Axis("run.seed", tuple(range(1, 25)))])[0]


def energies(folder: Path, work: list[Unit]) -> bytes:
    found = b""
    for unit in work:
        with h5py.File(folder / "units" / f"{unit.key}.h5") as file:
            found += np.asarray(file["image/energy"]).tobytes()
    return found


def processor_seconds() -> tuple[float, float]:
    """Seconds of processor time spent on this machine, and of them by this process and its workers."""
    import psutil

    times = psutil.cpu_times()
    here = psutil.Process()
    own = 0.0
    for process in (here, *here.children(recursive=True)):
        spent = process.cpu_times()
        own += spent.user + spent.system
    return sum(times) - times.idle - times.iowait, own


def wait_for_quiet(end: float) -> None:
    """Return when other programs leave the processors alone for a while, or when time is up."""
    while time.monotonic() < end:
        all_before, own_before = processor_seconds()
        time.sleep(SECONDS_OF_QUIET)
        all_after, own_after = processor_seconds()
        others = (all_after - all_before) - (own_after - own_before)
        if others < MOST_BY_OTHERS * SECONDS_OF_QUIET * len(os.sched_getaffinity(0)):
            return


def workers_seconds(cluster: Any) -> list[float]:
    """Seconds of processor time that each worker process has spent."""
    import psutil

    spent = [psutil.Process(worker.pid).cpu_times() for worker in cluster.workers.values()]
    return [times.user + times.system for times in spent]


def timed(work: list[Unit], cluster: Any) -> Timed:
    """Run the sweep once."""
    with tempfile.TemporaryDirectory() as folder:
        all_before, own_before = processor_seconds()
        workers_before = workers_seconds(cluster)
        start = time.perf_counter()
        outcome = run(work, folder, dask=cluster.scheduler_address)
        seconds = time.perf_counter() - start
        busiest = max(np.subtract(workers_seconds(cluster), workers_before))
        all_after, own_after = processor_seconds()
        assert len(outcome.records) == len(work), outcome.failures
        others = (all_after - all_before) - (own_after - own_before)
        share = max(0.0, others) / (seconds * len(os.sched_getaffinity(0)))
        return Timed(seconds, float(busiest), share, energies(Path(folder), work))


def main() -> None:
    from distributed import Client, LocalCluster

    turns = int(sys.argv[1]) if len(sys.argv) > 1 else TURNS
    work = units()
    clusters = {
        count: LocalCluster(n_workers=count, threads_per_worker=1, processes=True, dashboard_address=":0")
        for count in (1, 2)
    }
    for count, cluster in clusters.items():
        with Client(cluster) as client:  # every worker compiles, or reads its cache, before the clock runs
            client.run(lambda unit: unit.perform(1).total, work[0])
        assert len(cluster.workers) == count
    end = time.monotonic() + 60.0 * (float(sys.argv[2]) if len(sys.argv) > 2 else 10.0)
    quiet: list[float] = []
    busiest: list[float] = []
    bits = set()
    while len(quiet) < turns and (not busiest or time.monotonic() < end):
        wait_for_quiet(end)
        one, two = (timed(work, clusters[count]) for count in (1, 2))
        bits |= {one.bits, two.bits}
        busiest.append(one.busiest / two.busiest)
        counts = max(one.others, two.others) < MOST_BY_OTHERS
        if counts:
            quiet.append(one.seconds / two.seconds)
        print(
            f"1 worker {one.seconds:.2f} s, 2 workers {two.seconds:.2f} s: "
            f"{one.seconds / two.seconds:.2f} times as fast; busiest worker {one.busiest:.2f} and "
            f"{two.busiest:.2f} s; others took {100 * one.others:.0f} and {100 * two.others:.0f} % of the "
            f"processors{'' if counts else ': not counted'}",
            flush=True,
        )
    print(f"equal bits: {len(bits) == 1}")
    if quiet:
        print(f"median of {len(quiet)} quiet turns: {statistics.median(quiet):.2f} times as fast")
    if busiest:
        print(f"by the busiest worker, median of {len(busiest)}: {statistics.median(busiest):.2f} times")
    for cluster in clusters.values():
        cluster.close()


if __name__ == "__main__":
    main()
