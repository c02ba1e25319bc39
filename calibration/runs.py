"""Runs of equal frames: grouped from the table, judged together, handed to the joint fit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from calibration.errors import Fault
from calibration.folder import Row, Series
from calibration.levels import Levels
from calibration.setup import Setup
from calibration.tally import RunStatistics

CLIPPED_SHARE = 1e-3  # EMVA 1288 release 4 General: saturated where 0.1 to 0.2 % of the pixels clip
LEAST_FALL = 0.03  # relative; smaller steps back are errors of the source, not of the table
FEWEST_LEVELS = 4


class RunKey(NamedTuple):
    """What the frames of one run have in common; ``energy`` is None when it is not known."""

    kind: str
    gain: float
    energy: float | None
    gate_ns: float | None
    level: str


@dataclass(frozen=True)
class Run:
    """One run of equal frames: its rows and what they say."""

    key: RunKey
    rows: tuple[Row, ...]
    statistics: RunStatistics

    @property
    def where(self) -> str:
        """The first row, for messages."""
        return f"{self.rows[0].where} ({self.rows[0].path.name})"

    @property
    def light(self) -> tuple[object, ...] | None:
        """What names the light level of this run; None when nothing does."""
        if self.key.energy is not None:
            return (self.key.energy,)
        return (self.key.level, self.key.gate_ns) if self.key.level else None

    def with_mean(self, mean: float) -> Run:
        """The same run with its mean taken over other pixels."""
        return replace(self, statistics=replace(self.statistics, mean=mean))


def grouped(rows: Iterable[Row], *, kinds: Sequence[str]) -> dict[RunKey, list[Row]]:
    """Put the rows of these kinds together that share kind, setting, light and gate."""
    groups: dict[RunKey, list[Row]] = {}
    for row in rows:
        if row.kind in kinds:
            energy = None if math.isnan(row.energy) else row.energy
            gate = None if math.isnan(row.gate_ns) else row.gate_ns
            groups.setdefault(RunKey(row.kind, row.gain, energy, gate, row.level), []).append(row)
    return groups


def saturation_of(runs: Sequence[Run], setup: Setup) -> float:
    """Raw counts at which pixels saturate: stated, or where counts pile up, or full scale."""
    if setup.saturation_counts is not None:
        return setup.saturation_counts
    largest = max(run.statistics.largest for run in runs)
    piled = {
        run.light
        for run in runs
        if run.statistics.largest == largest and run.statistics.share_at_largest > CLIPPED_SHARE
    }
    return largest if len(piled) > 1 else float(setup.full_scale)


def clipped(run: Run, saturation: float) -> bool:
    """Whether too many pixels of a run are saturated for its mean and noise to be used."""
    found = run.statistics
    return found.largest >= saturation and found.share_at_largest > CLIPPED_SHARE


def usable(runs: Sequence[Run], saturation: float) -> list[Run]:
    """Runs that the response can be read from: not clipped, clearly above dark, of a light that is named."""
    return [
        run
        for run in runs
        if not clipped(run, saturation)
        and run.light is not None
        and run.statistics.mean > max(3.0 * run.statistics.mean_stderr, 0.05)
    ]


def faults_of_runs(runs: Sequence[Run], series: Series, saturation: float) -> list[Fault]:
    """Find what only the pictures tell: falling series, settings without light, gaps between settings."""
    faults = []
    by_setting: dict[float, list[Run]] = {gain: [] for gain in series.settings}
    for run in usable(runs, saturation):
        by_setting[run.key.gain].append(run)
    for gain, members in by_setting.items():
        faults += _falling(members, series)
        if not members:
            rows = [run.where for run in runs if run.key.gain == gain]
            state = (
                "saturated"
                if any(clipped(run, saturation) for run in runs if run.key.gain == gain)
                else "dark"
            )
            faults.append(
                Fault(
                    f"gain {gain:g}",
                    f"only {state} runs ({', '.join(rows[:4])})",
                    "at least one run between dark and saturation",
                )
            )
    known = {run.key.energy for run in usable(runs, saturation) if run.key.energy is not None}
    if len(known) < FEWEST_LEVELS and not len(series.setup.known_gain) > 1:
        faults.append(
            Fault(
                "light levels",
                f"{len(known)} known and usable",
                f"at least {FEWEST_LEVELS}, best 16",
                "Saturated and dark runs do not count.",
            )
        )
    return faults + _gaps({gain: members for gain, members in by_setting.items() if members})


def _falling(members: Sequence[Run], series: Series) -> list[Fault]:
    faults = []
    ordered = sorted(
        (run for run in members if run.key.energy is not None), key=lambda run: run.key.energy or 0.0
    )
    tolerance = max(LEAST_FALL, 5.0 * (series.setup.energy_stderr or 0.0))
    for dimmer, brighter in pairwise(ordered):
        fall = dimmer.statistics.mean - brighter.statistics.mean
        error = math.hypot(dimmer.statistics.mean_stderr, brighter.statistics.mean_stderr)
        if fall > tolerance * dimmer.statistics.mean + 5.0 * error:
            faults.append(
                Fault(
                    brighter.where,
                    f"{brighter.statistics.mean:.4g} counts above dark at energy {brighter.key.energy:g}",
                    f"more than the {dimmer.statistics.mean:.4g} counts at energy {dimmer.key.energy:g} in "
                    f"{dimmer.where}",
                    "More light gave fewer counts: check these rows.",
                )
            )
    return faults


def _gaps(by_setting: Mapping[float, Sequence[Run]]) -> list[Fault]:
    """Find settings whose counts overlap with no other's: their gain would be an extrapolation."""
    spans = sorted(
        (min(run.statistics.mean for run in members), max(run.statistics.mean for run in members), gain)
        for gain, members in by_setting.items()
    )
    chains: list[tuple[float, list[tuple[float, float, float]]]] = []
    for low, high, gain in spans:
        if chains and low <= chains[-1][0]:
            chains[-1] = (max(chains[-1][0], high), [*chains[-1][1], (low, high, gain)])
        else:
            chains.append((high, [(low, high, gain)]))
    if len(chains) < 2:
        return []
    main = max(chains, key=lambda chain: sum(len(by_setting[gain]) for _, _, gain in chain[1]))
    return [
        Fault(
            f"gain {gain:g} ({by_setting[gain][0].where})",
            f"counts from {low:.4g} to {high:.4g}, where no other setting has any",
            "counts that overlap with another setting's",
            "Add light levels, so that the ranges of neighbouring settings overlap.",
        )
        for chain in chains
        if chain is not main
        for low, high, gain in chain[1]
    ]


def levels_of(
    runs: Sequence[Run],
    series: Series,
    *,
    reference: float,
    dark_variance: Mapping[float, float],
    saturation_above_dark: float,
) -> Levels:
    """Put usable runs into the form of the joint fit."""
    gains = series.settings
    names: list[object] = []
    energies: list[float] = []
    level = []
    for run in runs:
        if run.light not in names:
            names.append(run.light)
            energies.append(run.key.energy or math.nan)
        level.append(names.index(run.light))
    log_energy = np.log(np.array(energies))
    if not np.isfinite(log_energy).any():
        log_energy[0] = 0.0  # only gains are known: the first level is the unit of energy
    setup = series.setup
    known = np.array(
        [math.log(setup.known_gain[gain]) if gain in setup.known_gain else math.nan for gain in gains]
    )
    return Levels(
        counts=np.array([run.statistics.mean for run in runs]),
        counts_stderr=np.array([run.statistics.mean_stderr for run in runs]),
        shot_variance=np.array([_shot_variance(run, dark_variance[run.key.gain]) for run in runs]),
        setting=np.array([gains.index(run.key.gain) for run in runs], dtype=np.intp),
        level=np.array(level, dtype=np.intp),
        log_energy=log_energy,
        gains=gains,
        reference=gains.index(reference),
        saturation=saturation_above_dark,
        level_stderr=setup.energy_stderr,
        known_log_gain=known - known[gains.index(reference)],
        known_stderr=setup.known_gain_stderr,
    )


def _shot_variance(run: Run, dark_variance: float) -> float:
    variance = run.statistics.variance - dark_variance
    return max(variance, 0.0) if math.isfinite(variance) else 0.0


def reference_of(runs: Sequence[Run], series: Series) -> float:
    """The setting with relative gain 1: stated, or the one with most response runs (the lowest of equals)."""
    if series.setup.reference_gain is not None:
        return series.setup.reference_gain

    def rank(gain: float) -> tuple[int, int, float]:
        here = [run.key.kind for run in runs if run.key.gain == gain]
        return here.count("response"), len(here), -gain

    return max(series.settings, key=rank)
