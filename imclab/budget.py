"""What each source of uncertainty does to the comparison of every condition."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from calibration import Calibration
from imclab.sighting import Seen, dark_of
from imclab.uncertainty import Effects

CALIBRATION_DRAWS = 200
PIXELS_FOR_DRAWS = 4000  # enough for the mean effect of a calibration error, which is smooth in counts
OF_THE_MEASUREMENT = ("frame to frame", "calibration", "registration")
OF_THE_NUMBERS = ("Monte Carlo",)
DRAWN_INPUTS = "inputs, drawn together"
PARTS = ("u_num", "u_input", "u_D")


def part_of(source: str) -> str:
    """Return the part of u_val (ASME V&V 20) that a source belongs to: u_num, u_input or u_D."""
    if source in OF_THE_MEASUREMENT:
        return "u_D"
    return "u_num" if source in OF_THE_NUMBERS else "u_input"


def parts_of(shares: Mapping[str, float]) -> dict[str, float]:
    """Gather a budget into u_num, u_input and u_D; each the root sum of squares of its sources."""
    return {
        part: math.hypot(*(u for source, u in shares.items() if part_of(source) == part)) for part in PARTS
    }


def sources_of(
    seen: Sequence[Seen], reference: Sequence[int], camera: Calibration, *, seed: int
) -> dict[str, Effects]:
    """Return the effects of every source of uncertainty on each condition's relative error.

    Parameters
    ----------
    reference : sequence of int
        For each condition, the index of the one it is compared with.
    seed : int
        Of the draws from the calibration's uncertainty.
    """
    simulation = [one.sighting.result.relative_error for one in seen]
    frames = [one.frame_error for one in seen]
    registration = [_registration_error(one) for one in seen]
    sources = {
        "Monte Carlo": _own(simulation, reference),
        "frame to frame": _own(frames, reference),
        "registration": _own(registration, reference),
        "calibration": _calibration_effects(seen, reference, camera, seed),
    }
    if all(one.sighting.drawn_totals for one in seen):
        return sources | {DRAWN_INPUTS: _drawn_effects(seen, reference)}
    return sources | input_sources(seen, reference)


def input_sources(seen: Sequence[Seen], reference: Sequence[int]) -> dict[str, Effects]:
    """Return the effects of each uncertain input by itself, to first order: one step of it."""
    sources = {}
    for key in sorted({key for one in seen for key in one.sighting.input_effects}):
        effects = [one.sighting.input_effects.get(key, (0.0, True)) for one in seen]
        change = [effect for effect, _ in effects]
        common = all(shared for _, shared in effects)
        sources[key] = _common(change, reference) if common else _own(change, reference)
    return sources


def _drawn_effects(seen: Sequence[Seen], reference: Sequence[int]) -> Effects:
    """Effects of all inputs together, from scenes drawn within their uncertainties (JCGM 101)."""
    ratio = np.log(np.array([one.sighting.drawn_totals for one in seen])).T
    ratio = ratio - ratio[:, list(reference)]
    return np.asarray((ratio - ratio.mean(axis=0)) / np.sqrt(len(ratio) - 1))


def _own(relative: Sequence[float], reference: Sequence[int]) -> Effects:
    """Effects of errors that each condition has for itself; a reference's goes into all its group."""
    effects = np.diag(np.asarray(relative, dtype=float))
    for condition, source in enumerate(reference):
        effects[source, condition] -= relative[source]
    return effects


def _common(relative: Sequence[float], reference: Sequence[int]) -> Effects:
    """Effects of one error that all conditions share."""
    change = np.asarray(relative, dtype=float)
    return np.asarray(change - change[list(reference)])[np.newaxis]


def _registration_error(seen: Seen) -> float:
    """Relative change of the simulated sum when the picture moves by the registration's error."""
    step = seen.registration.target_stderr_px
    changes = []
    for shift in ((step, 0.0), (0.0, step)):
        moved = np.roll(seen.simulated, 1, axis=1 if shift[0] else 0)
        slope = moved[seen.region].sum() / seen.simulated_sum - 1.0  # per pixel
        changes.append(slope * step)
    return float(np.hypot(*changes))


def _calibration_effects(
    seen: Sequence[Seen], reference: Sequence[int], camera: Calibration, seed: int
) -> Effects:
    """Effects of the calibration's errors: sums of energy under calibrations drawn from its covariance."""
    rng = np.random.default_rng(seed)
    drawn = camera.sample(CALIBRATION_DRAWS, seed=seed)
    logs = np.empty((len(drawn), len(seen)))
    for column, one in enumerate(seen):
        dark = dark_of(camera, one.sighting.gain)
        above = one.sighting.counts.mean(axis=0) - dark
        # One-dimensional counts are read as a typical pixel's: what pixels do not share has no part here.
        counts = rng.permutation(above[one.region])[:PIXELS_FOR_DRAWS] + np.median(dark)
        for row, other in enumerate(drawn):
            energy, _ = other.energy(counts, gain=one.sighting.gain)
            logs[row, column] = np.log(np.nansum(energy))
    relative = -(logs - logs[:, list(reference)])
    return np.asarray((relative - relative.mean(axis=0)) / np.sqrt(len(drawn) - 1))
