"""Gated pictures beside mitransient: ``python -m tests.figures.peers_pictures --python PATH``.

PATH is an interpreter with mitransient, ``DRJIT_LIBLLVM_PATH`` its LLVM. The scene is that of
``tests.figures.estimators``. Each seed renders one picture with every program in turn, one thread each;
CPU seconds are those of the whole process over the whole call, compiling not counted. A pixel's relative
variance is that between the seeds, over the square of a long run of ours, which first has to agree with
mitransient. Tables of docs/peers.md.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import imclab
from imclab.scene import Scene
from tests.figures.estimators import scene_at
from tests.figures.peer_process import Peer, cpu_seconds
from tests.judging import threshold

FloatArray = NDArray[np.float64]
DEPTHS = (0.42, 1.42)
PACKETS, EXPECTED_PACKETS, LONG_RUN = 960_000, 1_200_000, 16
"""Of ``auto``, of the plain next-event estimator, and how many times the former the reference has."""
REFERENCE_SEED = 1000
CLEAR_SAMPLES, CLEAR_TOLERANCE = 256, 1e-3
LIGHT_SPEED = 299_792_458.0


@dataclass
class Contestant:
    """A program: how it makes a picture, what it ought to show, and what it has made so far."""

    name: str
    render: Callable[[int], FloatArray]
    truth: FloatArray
    truth_error: float
    """Relative standard error of the truth's sum."""
    cpu: list[float] = field(default_factory=list)
    pictures: list[FloatArray] = field(default_factory=list)

    def run(self, seed: int) -> None:
        """Render once and keep picture and CPU seconds."""
        start = cpu_seconds()
        picture = self.render(seed)
        self.cpu.append(cpu_seconds() - start)
        self.pictures.append(picture)

    def relative_variance(self) -> FloatArray:
        """Return each pixel's variance between the seeds over the square of the truth."""
        variance: FloatArray = np.var(self.pictures, axis=0, ddof=1) / self.truth**2
        return variance

    def merits(self, where: NDArray[np.bool_]) -> tuple[float, float]:
        """Return the figures of merit of the median and of the RMS pixel, from the variance."""
        variance = self.relative_variance()[where]
        return 1.0 / (np.median(variance) * np.mean(self.cpu)), 1.0 / (variance.mean() * np.mean(self.cpu))

    def squares(self, where: NDArray[np.bool_]) -> FloatArray:
        """Return relative deviations from the truth, squared, (seeds, pixels)."""
        squares: FloatArray = (np.array(self.pictures)[:, where] / self.truth[where] - 1.0) ** 2
        return squares

    def rms_by_seed(self, where: NDArray[np.bool_]) -> FloatArray:
        """Return the root of the mean squared deviation for each seed."""
        rms: FloatArray = np.sqrt(self.squares(where).mean(axis=1))
        return rms

    def merits_by_seed(self, where: NDArray[np.bool_]) -> FloatArray:
        """Return the figures of merit of median and RMS pixel for each seed alone, (seeds, 2)."""
        squares, cost = self.squares(where), np.array(self.cpu)
        return np.stack(
            [1.0 / (np.median(squares, axis=1) * cost), 1.0 / (squares.mean(axis=1) * cost)], axis=1
        )


class Mitransient:
    """mitransient in its own process, with one scene at a time."""

    def __init__(self, peer: Peer, folder: Path, arguments: argparse.Namespace) -> None:
        self.peer, self.folder, self.arguments = peer, folder, arguments

    def load(self, scene: Scene) -> None:
        """Hand a scene over."""
        reflectance = self.folder / "reflectance.npy"
        target, ground = scene.target, scene.target.ground
        assert ground is not None
        figure = target.figure.reflectance  # type: ignore[union-attr]
        np.save(reflectance, np.where(scene.figure_mask, figure, ground.reflectance))  # type: ignore[union-attr]
        job = _job_of(scene) | {
            "reflectance": str(reflectance),
            "max_depth": self.arguments.max_depth,
            "roulette_depth": self.arguments.roulette_depth,
        }
        self.peer.ask("scene", job=job)

    def render(self, seed: int, samples: int) -> tuple[FloatArray, float]:
        """Return a picture and its CPU seconds in the other process."""
        file = self.folder / "picture.npy"
        answer = self.peer.ask("render", seed=seed, samples=samples, to=str(file))
        return np.load(file), answer["cpu"]


def _job_of(scene: Scene) -> dict[str, Any]:
    medium, laser, gate = scene.medium, scene.laser, scene.gate
    assert gate is not None
    return {
        "attenuation": medium.attenuation,
        "albedo": medium.albedo,
        "asymmetry": medium.phase_function.g,  # type: ignore[union-attr]
        "group_speed": LIGHT_SPEED / float(medium.group_index or 1.0),
        "divergence_sigma": laser.divergence_fwhm / 2.3548,
        "pulse_sigma": laser.pulse_fwhm / 2.3548,
        "pulse_energy": laser.pulse_energy,
        "gate_width": gate.width,
        "distance": scene.target.distance,
        "width": scene.target.width,
        "aperture": scene.receiver.aperture_radius,
        "pixels": scene.receiver.pixels[0],
    }


def ours(scene: Scene, *, seed: int, packets: float, estimator: str = "auto") -> imclab.Result:
    """Return a picture of this project on one thread."""
    result: imclab.Result = imclab.simulate(
        scene, packets=packets, seed=seed, threads=1, time_bins=0, estimator=estimator
    )
    return result


def check_clear_water(other: Mitransient) -> None:
    """Refuse to go on unless both show the same picture through clear water, pixel by pixel."""
    scene = scene_at(0.42).with_(**{"medium.attenuation": "1e-6 1/m"})
    other.load(scene)
    theirs, _ = other.render(1, CLEAR_SAMPLES)
    picture = ours(scene, seed=1, packets=1e5).energy
    ratio, total = theirs / picture, theirs.sum() / picture.sum() - 1.0
    off = float(np.median(np.abs(ratio - 1.0)))
    print(f"clear water: total differs by {total:.1e}, median pixel by {off:.1e}", flush=True)
    if not (abs(total) < CLEAR_TOLERANCE and off < CLEAR_TOLERANCE):
        raise SystemExit("not the same job: nothing is timed")


def check_agreement(theirs: Contestant) -> None:
    """Refuse to go on unless the pictures' sums agree within the errors between seeds."""
    totals = np.array(theirs.pictures).sum(axis=(1, 2)) / theirs.truth.sum()
    error = float(np.hypot(totals.std(ddof=1) / len(totals) ** 0.5, theirs.truth_error))
    z = (totals.mean() - 1.0) / error
    print(f"{theirs.name}: total / reference {totals.mean():.5f} +- {error:.5f}, Z = {z:.1f}", flush=True)
    if not abs(z) < threshold(1, degrees=len(totals) - 1):
        raise SystemExit("not the same job: no figures")


def contest(depth: float, other: Mitransient, arguments: argparse.Namespace) -> list[Contestant]:
    """Let every program make a picture with each seed, in turn."""
    scene = scene_at(depth)
    other.load(scene)
    reference = ours(scene, seed=REFERENCE_SEED, packets=LONG_RUN * PACKETS)
    error = reference.relative_error
    everyone = [
        Contestant(
            "auto", lambda seed: ours(scene, seed=seed, packets=PACKETS).energy, reference.energy, error
        ),
        Contestant(
            "expected",
            lambda seed: ours(scene, seed=seed, packets=EXPECTED_PACKETS, estimator="expected").energy,
            reference.energy,
            error,
        ),
    ]
    # mitransient is asked for light of the target's return and later: hardly any of the backscatter.
    theirs = Contestant("mitransient", lambda _: np.zeros(0), reference.target, error)
    for seed in range(arguments.seeds + 1):
        for one in everyone:
            one.run(seed)
        picture, cost = other.render(seed, arguments.samples)
        theirs.pictures.append(picture)
        theirs.cpu.append(cost)
        if seed == 0:  # everything is compiled now
            for one in (*everyone, theirs):
                one.pictures.clear()
                one.cpu.clear()
    for one in (*everyone, theirs):
        check_agreement(one)
    return [*everyone, theirs]


def whole_figure(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return which pixels lie wholly on the figure."""
    mask = scene_at(DEPTHS[0]).figure_mask
    rows, columns = shape
    cells = mask.reshape(rows, mask.shape[0] // rows, columns, mask.shape[1] // columns)
    return np.asarray(cells.all(axis=(1, 3)))


def table(depth: float, everyone: list[Contestant], where: NDArray[np.bool_], name: str) -> None:
    """Print the table of one optical depth for the pixels ``where``."""
    theirs = everyone[-1]
    print(f"\noptical depth {depth}, {name}: {where.sum()} pixels, {len(theirs.cpu)} seeds")
    print(
        "| program | CPU s | pixel error, median | RMS | merit, median | RMS | x mitransient, median | RMS |"
    )
    print("|---|---|---|---|---|---|---|---|")
    base = theirs.merits(where)
    for one in everyone:
        variance, merit = one.relative_variance()[where], one.merits(where)
        print(
            f"| {one.name} | {np.mean(one.cpu):.2f} | {100 * np.median(variance) ** 0.5:.2f} % | "
            f"{100 * variance.mean() ** 0.5:.2f} % | {merit[0]:.3g} | {merit[1]:.3g} | "
            f"{merit[0] / base[0]:.3g} | {merit[1] / base[1]:.3g} |"
        )
    for one in everyone:
        rms = 100.0 * one.rms_by_seed(where)
        print(f"{one.name}: RMS pixel error of each seed {rms.min():.2f} to {rms.max():.2f} %")
    mine, best = everyone[0].merits_by_seed(where), theirs.merits_by_seed(where).max(axis=0)
    print(
        f"seed by seed, least of auto over greatest of mitransient: median {mine[:, 0].min() / best[0]:.3g}, "
        f"RMS {mine[:, 1].min() / best[1]:.3g}",
        flush=True,
    )


def main() -> None:
    """Validate, run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--python", required=True, help="interpreter with mitransient")
    parser.add_argument("--seeds", type=int, default=24)
    parser.add_argument("--samples", type=int, default=96, help="samples per pixel of mitransient")
    parser.add_argument("--max-depth", type=int, default=16, help="collisions and reflections at most")
    parser.add_argument("--roulette-depth", type=int, default=5)
    parser.add_argument("--depths", type=float, nargs="*", default=DEPTHS)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, Peer(arguments.python, "mitransient_worker.py") as peer:
        print(peer.ask("versions"))
        other = Mitransient(peer, Path(name), arguments)
        check_clear_water(other)
        for depth in arguments.depths:
            everyone = contest(depth, other, arguments)
            shape = everyone[0].truth.shape
            table(depth, everyone, np.ones(shape, dtype=bool), "all pixels")
            table(depth, everyone, whole_figure(shape), "the figure")


if __name__ == "__main__":
    main()
