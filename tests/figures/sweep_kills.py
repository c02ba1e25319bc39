"""A sweep killed twice has the bits of one that is not: ``python -m tests.figures.sweep_kills``.

24 scenes: three waters, two distances, two targets and two seeds. With two worker processes, one is killed by
``kill -9`` and then the whole sweep; the same command goes on. The same on a local Dask cluster, where a
worker process is killed and then the sweep. Compared with one uninterrupted run by one worker: every
picture and its errors, and the tables byte for byte. Two and four workers without kills come last.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

ROOT = Path(__file__).parents[2]
WORDS = [
    *(sys.executable, "-m", "imclab", "sweep", "data/scenes/lambertian_slit.toml", "--packets", "2e5"),
    *("--set", "medium.attenuation=0.42 1/m,0.92 1/m,1.42 1/m", "--set", "target.distance=0.8 m,1 m"),
    *("--set", "target.mask=../targets/double_slit.png,../targets/diver.png", "--set", "run.seed=1,2"),
    *("--set", "receiver.pixels=[50, 50]", "--json"),
]
SCENES = 24


def sweep(folder: Path, *where: str) -> dict[str, Any]:
    """Run to the end and return the summary."""
    done = subprocess.run([*WORDS, "-o", str(folder), *where], cwd=ROOT, capture_output=True, check=True)
    return dict(json.loads(done.stdout))


def finished(folder: Path) -> int:
    return len(list((folder / "units").glob("*.h5")))


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 300.0
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.02)


def workers_of(parent: int) -> list[int]:
    """The worker processes of a sweep."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            words = (status.parent / "cmdline").read_text()
            if f" {parent} " in status.read_text().rpartition(")")[2][:16] and "spawn_main" in words:
                found.append(int(status.parent.name))
    return found


def killed_twice(folder: Path, workers: Callable[[int], list[int]], *where: str) -> tuple[int, int]:
    """Kill a worker, then the sweep; return how many scenes were finished at either kill."""
    with subprocess.Popen(
        [*WORDS, "-o", str(folder), *where], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        wait_for(lambda: finished(folder) >= SCENES // 6)
        at_first = finished(folder)
        os.kill(workers(process.pid)[0], signal.SIGKILL)
        wait_for(lambda: finished(folder) >= SCENES // 2)
        process.kill()
    return at_first, finished(folder)


def contents(folder: Path) -> dict[str, bytes]:
    """Return the bits of every picture with its errors, and the tables."""
    found = {name: (folder / name).read_bytes() for name in ("table.csv", "table.h5")}
    for path in (folder / "units").glob("*.h5"):
        with h5py.File(path) as file:
            parts = [np.asarray(file[f"image/{part}"]).tobytes() for part in ("energy", "stderr", "target")]
        found[path.name] = b"".join(parts)
    assert len(found) == SCENES + 2
    return found


def main() -> None:
    from distributed import LocalCluster

    with (
        tempfile.TemporaryDirectory() as temporary,
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0") as cluster,
    ):
        root = Path(temporary)
        sweep(root / "whole", "--workers", "1")
        reference = contents(root / "whole")
        dask = ("--dask", cluster.scheduler_address)
        for name, where, workers in (
            ("2 worker processes", ("--workers", "2"), workers_of),
            ("Dask, 2 worker processes", dask, lambda _: [w.pid for w in cluster.workers.values()]),
        ):
            folder = root / name
            first, second = killed_twice(folder, workers, *where)
            assert second < SCENES, "the kill came too late to mean anything"
            resumed = sweep(folder, *where)["resumed"]
            print(
                f"{name}: worker killed at {first}, all at {second} of {SCENES} scenes; {resumed} found "
                f"finished; equal bits: {contents(folder) == reference}",
                flush=True,
            )
        for count in ("2", "4"):
            sweep(root / count, "--workers", count)
            print(f"{count} workers, no kill; equal bits: {contents(root / count) == reference}", flush=True)


if __name__ == "__main__":
    main()
