"""A unit of work: one scene, what to run of it, and the name that its result is kept under."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import imclab
from imclab.errors import InputError
from imclab.media import Table
from imclab.result import Flux, Result
from imclab.scene import Scene
from imclab.sweep.axes import Axis, combine

_LIMITS = ("rel_error", "seconds", "packets")


@dataclass(frozen=True)
class OneWay:
    """Ask for `imclab.transmit` at some planes (m); at the target's distance when there are none."""

    distances: tuple[float, ...] = ()


@dataclass(frozen=True)
class Unit:
    """One scene of a sweep.

    Attributes
    ----------
    index : int
        Place in the sweep, from 0.
    changes : mapping
        What of the base scene was changed.
    scene : Scene
        Its ``[run]`` says how long and with which seed.
    one_way : OneWay or None
        One way through the water instead of a picture.
    """

    index: int
    changes: Mapping[str, Any]
    scene: Scene
    one_way: OneWay | None = None

    @property
    def record_type(self) -> type[Result] | type[Flux]:
        """Class of what comes out."""
        return Result if self.one_way is None else Flux

    def perform(self, threads: int | None) -> Result | Flux:
        """Run the scene on some threads, or on all."""
        if self.one_way is None:
            result: Result = imclab.simulate(self.scene, threads=threads)
            return result
        flux: Flux = imclab.transmit(self.scene, distances=self.one_way.distances or None, threads=threads)
        return flux

    @cached_property
    def key(self) -> str:
        """Name of the unit's result: a digest of all that its numbers depend on.

        The scene's words, the files that it names, the planes and the version of imclab. A sweep that
        is widened therefore finds again what it has finished, and never takes an old result for a
        changed scene.
        """
        digest = hashlib.sha256(f"{imclab.__version__} {self.one_way} {self.scene.toml}".encode())
        digest.update(self.scene.figure_mask.tobytes())
        phase_function = self.scene.medium.phase_function
        if isinstance(phase_function, Table) and phase_function.file is not None:
            digest.update((self.scene.folder / phase_function.file).read_bytes())
        return digest.hexdigest()[:20]


@dataclass(frozen=True)
class Refused:
    """A combination of values that makes no scene, and why."""

    index: int
    changes: Mapping[str, Any]
    reason: str


def with_run(scene: Scene, **asked: Any) -> Scene:
    """Return the scene with what was asked of the run; a limit replaces whichever the scene had.

    Parameters
    ----------
    scene : Scene
    **asked
        Keys of ``[run]``: rel_error, seconds, packets, estimator, seed; ``None`` leaves one alone.

    Raises
    ------
    InputError
        Values out of range, or several limits at once.
    """
    changes = {f"run.{name}": value for name, value in asked.items() if value is not None}
    if any(f"run.{name}" in changes for name in _LIMITS):
        changes = {f"run.{name}": None for name in _LIMITS} | changes
    return scene.with_(**changes)


def plan(
    scene: Scene, axes: Iterable[Axis], *, one_way: OneWay | None = None, zipped: bool = False
) -> tuple[list[Unit], list[Refused]]:
    """Make the units of a sweep; combinations that make no scene are told apart.

    Every unit has the seed of the base scene, so that it equals what `imclab simulate` gives for its
    scene; sweep ``run.seed`` for independent repeats.

    Raises
    ------
    InputError
        When no combination makes a scene: with the faults of the first.
    """
    units: list[Unit] = []
    refused: list[Refused] = []
    first_error: InputError | None = None
    for index, changes in enumerate(combine(list(axes), zipped=zipped)):
        try:
            units.append(Unit(index, changes, scene.with_(**changes), one_way))
        except InputError as error:
            first_error = first_error or error
            refused.append(Refused(index, changes, "; ".join(str(fault) for fault in error.faults)))
    if first_error is not None and not units:
        raise InputError("--set", first_error.faults)
    return units, refused
