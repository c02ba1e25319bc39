"""How much faster two workers finish a sweep than one: ``python -m tests.figures.sweep [TURNS]``.

A local Dask cluster with one worker process and one with two, the same 24 scenes, in turns. Each turn gives
one ratio of wall times, so that a load that comes and goes meets both alike; their median is told. The
bits of all runs are compared.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

from imclab.scene import load_scene
from imclab.sweep import Axis, Unit, plan, run, with_run

SCENE = Path(__file__).parents[2] / "data/scenes/lambertian_slit.toml"
PACKETS = 4e5
TURNS = 3


def units() -> list[Unit]:
    scene = with_run(load_scene(SCENE), packets=PACKETS).with_(**{"receiver.pixels": [50, 50]})
    return plan(scene, [Axis("run.seed", tuple(range(1, 25)))])[0]


def energies(folder: Path, work: list[Unit]) -> bytes:
    found = b""
    for unit in work:
        with h5py.File(folder / "units" / f"{unit.key}.h5") as file:
            found += np.asarray(file["image/energy"]).tobytes()
    return found


def timed(work: list[Unit], **where: object) -> tuple[float, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        outcome = run(work, folder, **where)  # type: ignore[arg-type]
        seconds = time.perf_counter() - start
        assert len(outcome.records) == len(work), outcome.failures
        return seconds, energies(Path(folder), work)


def main() -> None:
    from distributed import Client, LocalCluster

    work = units()
    seconds: dict[str, list[float]] = {}
    bits = set()
    clusters = {
        count: LocalCluster(n_workers=count, threads_per_worker=1, processes=True, dashboard_address=":0")
        for count in (1, 2)
    }
    for (
        count,
        cluster,
    ) in clusters.items():  # every worker compiles, or reads its cache, before the clock runs
        with Client(cluster) as client:
            client.run(lambda unit: unit.perform(1).total, work[0])
        assert len(cluster.workers) == count
    for _ in range(int(sys.argv[1]) if len(sys.argv) > 1 else TURNS):
        for count, cluster in clusters.items():
            taken, found = timed(work, dask=cluster.scheduler_address)
            seconds.setdefault(f"Dask, {count} worker processes", []).append(taken)
            bits.add(found)
    for name, values in seconds.items():
        print(f"{name}: median {statistics.median(values):.2f} s of {[round(value, 2) for value in values]}")
    one, two = (seconds[f"Dask, {count} worker processes"] for count in (1, 2))
    ratios = [before / after for before, after in zip(one, two, strict=True)]
    print(
        f"two over one: {statistics.median(ratios):.2f} times as fast, median of "
        f"{[round(ratio, 2) for ratio in ratios]}; equal bits: {len(bits) == 1}"
    )
    for cluster in clusters.values():
        cluster.close()


if __name__ == "__main__":
    main()
