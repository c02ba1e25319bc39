"""One way through a slab beside OpenCL programs: ``python -m tests.figures.peers_one_way --python PATH``.

PATH is an interpreter with ``pyopencl`` and ``pmcxcl`` and a CPU driver. A pencil beam crosses 1 m
(Henyey-Greenstein 0.924, albedo 0.89, no change of index). Each round runs every program in turn, one thread
each; CPU seconds are those of the process. Those of the other programs are differences between two
sizes, so that compiling does not count; those of ``imclab.transmit`` are whole calls. Table of docs/peers.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np

import imclab
from imclab.scene import Scene
from imclab.transport.setup import Beam
from tests.figures.peer_process import Peer, cpu_seconds
from tests.figures.transport_speed import SCENE
from tests.judging import reject
from tests.oracles_transport import forward_histories

ALBEDO, ASYMMETRY, THICKNESS = 0.89, 0.924, 1.0
PENCIL = Beam(1e-6, 1e-7)
BLOCKS = 100
TOLERANCE = 5e-4
"""Difference of the transmitted share, relative, that is put down to single precision and fast functions."""


@dataclass(frozen=True)
class Crossing:
    """Of one run: CPU seconds per packet, transmitted share, variance of one packet's share, packets."""

    cost: float
    transmitted: float
    variance: float
    packets: float


@dataclass
class Contestant:
    """A program, how many packets it gets, and its runs."""

    name: str
    run: Callable[[int, int], Crossing]
    packets: int
    runs: list[Crossing] = field(default_factory=list)

    @property
    def cost(self) -> float:
        """Median CPU seconds per packet."""
        return float(np.median([run.cost for run in self.runs]))

    @property
    def transmitted(self) -> float:
        return float(np.mean([run.transmitted for run in self.runs]))

    @property
    def variance(self) -> float:
        return float(np.mean([run.variance for run in self.runs]))

    @property
    def stderr(self) -> float:
        return float(np.sqrt(self.variance / sum(run.packets for run in self.runs)))

    def merits(self) -> list[float]:
        """Return the figure of merit of the transmitted share for each round."""
        return [self.transmitted**2 / (self.variance * run.cost) for run in self.runs]


def scene_at(attenuation: float) -> Scene:
    """Return the slab as a scene."""
    return imclab.load_scene(SCENE).with_(
        **{
            "medium.attenuation": f"{attenuation} 1/m",
            "medium.albedo": ALBEDO,
            "medium.phase_function": {"kind": "henyey-greenstein", "g": ASYMMETRY},
            "laser.divergence_fwhm": f"{2.3548 * PENCIL.divergence_sigma} rad",
            "laser.spot_fwhm": f"{2.3548 * PENCIL.spot_sigma} m",
        }
    )


def transmit(scene: Scene) -> Callable[[int, int], Crossing]:
    """Return this project's run."""

    def run(packets: int, seed: int) -> Crossing:
        start = cpu_seconds()
        flux = imclab.transmit(scene, packets=packets, distances=[THICKNESS], seed=seed, threads=1)
        cost = (cpu_seconds() - start) / flux.packets
        variance = float(flux.transmitted_stderr[0]) ** 2 * flux.packets
        return Crossing(cost, float(flux.transmitted[0]), variance, flux.packets)

    return run


def histories(attenuation: float) -> Callable[[int, int], Crossing]:
    """Return the plain loop's run: its variance is that between blocks."""

    def run(packets: int, seed: int) -> Crossing:
        block, shares = packets // BLOCKS, []
        start = cpu_seconds()
        for index in range(BLOCKS):
            sums = np.zeros(8)
            water = (attenuation, ALBEDO, ASYMMETRY)
            forward_histories(water, PENCIL, THICKNESS, block, BLOCKS * seed + index, sums)
            shares.append(sums[0] / block)
        cost = (cpu_seconds() - start) / (block * BLOCKS)
        return Crossing(cost, float(np.mean(shares)), float(np.var(shares, ddof=1)) * block, block * BLOCKS)

    return run


def other(peer: Peer, attenuation: float, absorption: str) -> Callable[[int, int], Crossing]:
    """Return another program's run; its cost is the difference between a tenth of the packets and all."""
    job = {
        "scattering": attenuation * ALBEDO,
        "absorption": attenuation * (1.0 - ALBEDO),
        "asymmetry": ASYMMETRY,
        "thickness": THICKNESS,
    }

    def run(packets: int, seed: int) -> Crossing:
        few, many = (
            peer.ask("run", job=job, packets=count, seed=seed, absorption=absorption)
            for count in (packets // 10, packets)
        )
        cost = (many["cpu"] - few["cpu"]) / (packets - packets // 10)
        return Crossing(cost, many["transmitted"], many["variance"], packets)

    return run


def contest(attenuation: float, peers: dict[str, Peer], rounds: int) -> list[Contestant]:
    """Let every program send its packets, in turn, and refuse to go on unless they agree."""
    loop, mcx = peers["loop"], peers["mcx"]
    everyone = [
        Contestant("imclab.transmit", transmit(scene_at(attenuation)), 30_000_000),
        Contestant("plain loop, float64, numba", histories(attenuation), 3_000_000),
        Contestant("OpenCL loop, at collisions", other(loop, attenuation, "at collisions"), 10_000_000),
        Contestant("OpenCL loop, along the path", other(loop, attenuation, "along the path"), 10_000_000),
        Contestant("MCX-CL", other(mcx, attenuation, "along the path"), 3_000_000),
    ]
    for one in everyone:  # compiles
        one.packets = max(BLOCKS, round(one.packets / max(1.0, 0.7 * attenuation)))
        one.run(one.packets // 10, rounds)
    for seed in range(rounds):
        for one in everyone:
            one.runs.append(one.run(one.packets, seed))
    check_agreement(attenuation, everyone)
    return everyone


def check_agreement(attenuation: float, everyone: list[Contestant]) -> None:
    """Refuse to go on unless all found the same transmitted share."""
    first = everyone[0]
    print(f"\nc = {attenuation:g} 1/m, transmitted share against imclab.transmit:")
    for one in everyone[1:]:
        off = one.transmitted - first.transmitted
        z = off / float(np.hypot(one.stderr, first.stderr))
        print(f"    {one.name}: {off / first.transmitted:+.1e} relative, Z = {z:.1f}")
        if reject(z) and abs(off) > TOLERANCE * first.transmitted:
            raise SystemExit("not the same job: no figures")


def table(everyone: list[Contestant]) -> None:
    """Print the table of one water."""
    print(
        "| program | transmitted | packets/s | merit | ours / its packets | ours / its merit, least to most |"
    )
    print("|---|---|---|---|---|---|")
    first = everyone[0]
    for one in everyone:
        ratio = np.array(first.merits()) / np.array(one.merits())
        print(
            f"| {one.name} | {one.transmitted:.5f}({1e5 * one.stderr:.0f}) | {1 / one.cost:.3g} | "
            f"{np.median(one.merits()):.3g} | {one.cost / first.cost:.1f} | "
            f"{np.median(ratio):.1f} ({ratio.min():.1f} to {ratio.max():.1f}) |",
            flush=True,
        )


def main() -> None:
    """Validate, run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--python", required=True, help="interpreter with pyopencl and pmcxcl")
    parser.add_argument("--preload", default="", help="library that the driver needs loaded first")
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    environment = {"POCL_MAX_PTHREAD_COUNT": "1", "LD_PRELOAD": arguments.preload}
    with ExitStack() as stack:
        peers = {
            name: stack.enter_context(
                Peer(arguments.python, "opencl_worker.py", name, environment=environment)
            )
            for name in ("loop", "mcx")
        }
        print(*(peer.ask("versions") for peer in peers.values()))
        for attenuation in (0.42, 1.42, 10.0):
            table(contest(attenuation, peers, arguments.rounds))


if __name__ == "__main__":
    main()
