"""Speed of the forward engine: beside one history after another, over threads, and from the cache.

``python -m tests.figures.transport_speed`` prints the table of docs/transport.md. Packets per second are
of CPU time, each figure the best of interleaved rounds, so that only ratios within one run count.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from imclab.transport import oneway
from imclab.transport.scattering import HenyeyGreensteinLaw
from imclab.transport.setup import Beam
from tests.one_way import water
from tests.oracles_transport import forward_histories

BEAM = Beam(1e-3 / 2.3548, 0.2 / 2.3548)
ROUNDS = 9
SCENE = Path(__file__).parents[2] / "data" / "scenes" / "jerlov_one_way.toml"


def forward_against_histories() -> None:
    print("| c (1/m) | histories (packets/s) | lanes (packets/s) | ratio | lanes, ns per collision |")
    print("|---|---|---|---|---|")
    for attenuation in (0.42, 1.42, 10.0):
        estimator, _ = oneway.make(
            water(attenuation, 0.89), HenyeyGreensteinLaw(0.924), BEAM, planes=[1.0], delay_scale=1.0
        )
        count = estimator.batch_size
        sums = np.zeros(8)
        estimator.batch(1, 0, 0)
        forward_histories((attenuation, 0.89, 0.924), BEAM, 1.0, 1, 1, sums)
        lanes, histories, collisions = [], [], 0.0
        for seed in range(ROUNDS):
            start = time.process_time()
            collisions = float(estimator.batch(seed, 0, count)["collisions"][0])
            lanes.append((time.process_time() - start) / count)
            start = time.process_time()
            forward_histories((attenuation, 0.89, 0.924), BEAM, 1.0, count // 10, seed, sums)
            histories.append((time.process_time() - start) / (count // 10))
        one, other = min(lanes), min(histories)
        print(
            f"| {attenuation:g} | {1 / other:.3g} | {1 / one:.3g} | {other / one:.1f} | "
            f"{1e9 * one * count / collisions:.1f} |",
            flush=True,
        )


def threads() -> None:
    import imclab

    scene = imclab.load_scene(SCENE)
    rates: dict[int, list[float]] = {1: [], 2: []}
    imclab.transmit(scene, packets=1e5)
    for seed in range(ROUNDS):
        for count, found in rates.items():
            flux = imclab.transmit(scene, packets=2e7, threads=count, seed=seed)
            found.append(flux.packets / flux.wall_seconds)
    print(f"2 threads over 1: {max(rates[2]) / max(rates[1]):.2f} (best of {ROUNDS} each)", flush=True)


_FIRST_PACKET = """
import time
start, cpu = time.perf_counter(), time.process_time()
import imclab
scene = imclab.load_scene({scene!r})
imclab.{call}(scene, packets=64, threads=1{more})
print(time.perf_counter() - start, time.process_time() - cpu)
"""


def first_calls() -> None:
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": folder}
        for call, more in (
            ("transmit", ""),
            ("simulate", ", estimator='analog'"),
            ("simulate", ", estimator='expected'"),
            ("simulate", ", estimator='two-sided'"),
        ):
            program = _FIRST_PACKET.format(scene=str(SCENE), call=call, more=more)
            for which in ("first process", "next process, from the cache"):
                done = subprocess.run(
                    [sys.executable, "-c", program],
                    env=environment,
                    capture_output=True,
                    text=True,
                    check=True,
                )
                wall, cpu = map(float, done.stdout.split())
                print(f"{call}{more}: {which}: {wall:.1f} s of wall clock, {cpu:.1f} s of CPU", flush=True)


if __name__ == "__main__":
    forward_against_histories()
    threads()
    first_calls()
