"""Figures of merit of a calibrated camera, named after EMVA 1288 release 4.

For a bare sensor (``intensified = false``) the Linear module's names hold: K, quantum efficiency.
An intensified camera is a black box (General module): events take the place of photoelectrons and
only QE/F^2 can be told, unless the excess noise factor is given.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.correct import Defect, fixed_pattern
from calibration.curve import Response
from calibration.noise import Transfer, event_energy
from calibration.setting import Figure
from calibration.setup import Setup
from calibration.stages import DarkField, FlatField

Floats = NDArray[np.float64]
QUANTISATION = 1.0 / 12.0  # variance of rounding to whole counts


@dataclass(frozen=True)
class Evidence:
    """All that the figures of one camera are computed from."""

    setup: Setup
    response: Response
    gains: tuple[float, ...]
    log_gain: Floats
    log_gain_stderr: Sequence[float]
    transfers: Sequence[Transfer]
    shot_systematic: Sequence[float]
    darks: Mapping[float, DarkField]
    flats: Mapping[float, FlatField]
    defects: NDArray[np.uint8]
    saturation_counts: float
    energy_in_joule: bool
    linearity: tuple[float, float]


def figures_of_merit(evidence: Evidence) -> tuple[Figure, ...]:
    """Compute every figure, per setting and for the camera."""
    figures: list[Figure] = []
    for index in range(len(evidence.gains)):
        figures += _of_setting(evidence, index)
    figures += _of_camera(evidence)
    return tuple(figures)


def _of_setting(evidence: Evidence, index: int) -> list[Figure]:
    gain = evidence.gains[index]
    transfer = evidence.transfers[index]
    dark = evidence.darks[gain]
    good = evidence.defects == 0

    def figure(name: str, value: float, stderr: float, unit: str, systematic: float = 0.0) -> Figure:
        return Figure(name, gain, value, stderr, systematic, unit)

    middle = 0.5 * (evidence.response.lowest + evidence.response.highest)
    per_exposure = 1.0 / float(evidence.response.secant(np.array([middle]))[0])
    conversion = transfer.shot * per_exposure
    relative = transfer.shot_stderr / transfer.shot if transfer.shot > 0.0 else math.nan
    dark_deviation = math.sqrt(transfer.read_variance)
    read_variance = max(transfer.read_variance - QUANTISATION, 0.0)
    read = math.sqrt(read_variance)
    read_stderr = (
        transfer.read_variance_stderr / (2.0 * read)
        if read > 0.0
        else math.sqrt(transfer.read_variance_stderr)
    )
    figures = [
        figure(
            "relative gain",
            math.exp(evidence.log_gain[index]),
            math.exp(evidence.log_gain[index]) * evidence.log_gain_stderr[index],
            "1",
        ),
        figure(
            "conversion gain K at mid range",
            conversion,
            conversion * relative,
            "DN/event",
            conversion * evidence.shot_systematic[index],
        ),
        figure("noise spread (sum of noise correlation)", transfer.spread, transfer.spread_stderr, "1"),
        figure("dark level", float(np.median(dark.picture[good])), dark.statistics.mean_stderr, "DN"),
        figure("dark drift over the series", dark.drift, 2.0 * dark.statistics.mean_stderr, "DN"),
        figure(
            "dark noise",
            dark_deviation,
            transfer.read_variance_stderr / (2.0 * max(dark_deviation, 1e-9)),
            "DN",
        ),
        figure("read noise (rounding taken off)", read, read_stderr, "DN"),
    ]
    figures += _fixed_patterns(evidence, gain, transfer)
    top = float(evidence.response.table[1][-1])
    if transfer.shot > 0.0:
        events = top / (transfer.shot * transfer.spread)
        error = math.hypot(relative, transfer.spread_stderr / transfer.spread)
        figures.append(figure("events at the top of the range", events, events * error, "events"))
        figures += _detection_limit(evidence, index, top)
    return figures


def _fixed_patterns(evidence: Evidence, gain: float, transfer: Transfer) -> list[Figure]:
    """DSNU of the dark frames and PRNU of the flat frames, temporal noise taken off."""
    good = evidence.defects == 0
    dark = evidence.darks[gain]
    noise = math.sqrt(transfer.read_variance / dark.statistics.frames)
    value, stderr = fixed_pattern(dark.picture[good], noise_of_mean=noise)
    figures = [Figure("DSNU", gain, value, stderr, 0.0, "DN")]
    if gain in evidence.flats:
        flat = evidence.flats[gain]
        level = flat.run.statistics.mean
        value, stderr = fixed_pattern(flat.picture[good], noise_of_mean=flat.relative_noise * level)
        figures.append(Figure("PRNU", gain, value / level, stderr / level, 0.0, "1"))
    return figures


def _detection_limit(evidence: Evidence, index: int, top: float) -> list[Figure]:
    """Energy at which signal equals noise (EMVA 1288 General: SNR_p = 1) and the dynamic range from there."""
    transfer = evidence.transfers[index]
    slope = float(evidence.response.exposure_per_count(np.array([0.0]))[0])
    dark = transfer.read_variance * slope**2
    limit = 0.5 * (transfer.shot + math.sqrt(transfer.shot**2 + 4.0 * dark))  # x^2 = dark + shot x
    scale = math.exp(evidence.log_gain[index])
    error = 0.5 * math.hypot(
        transfer.shot_stderr / transfer.shot,
        transfer.read_variance_stderr / max(transfer.read_variance, 1e-12),
    )
    unit = "J" if evidence.energy_in_joule else "relative"
    gain = evidence.gains[index]
    return [
        Figure("energy at SNR 1, one pixel", gain, limit / scale, limit / scale * error, 0.0, unit),
        Figure("dynamic range", gain, top / limit, top / limit * error, 0.0, "1"),
    ]


def _of_camera(evidence: Evidence) -> list[Figure]:
    nowhere = math.nan
    figures = [
        Figure("saturation", nowhere, evidence.saturation_counts, 0.0, 0.0, "DN"),
        Figure("linearity error", nowhere, *evidence.linearity, 0.0, "1"),
    ]
    for defect in Defect:
        count = int(np.count_nonzero(evidence.defects & np.uint8(defect)))
        figures.append(Figure(f"{(defect.name or '').lower()} pixels", nowhere, count, 0.0, 0.0, "pixels"))
    gain = np.exp(evidence.log_gain)
    usable = [index for index, transfer in enumerate(evidence.transfers) if transfer.shot > 0.0]
    if not usable:
        return figures
    transfers = [evidence.transfers[index] for index in usable]
    value = np.array([transfer.shot * transfer.spread for transfer in transfers]) / gain[usable]
    relative = np.array(
        [
            math.hypot(transfer.shot_stderr / transfer.shot, transfer.spread_stderr / transfer.spread)
            for transfer in transfers
        ]
    )
    event = event_energy(value, value * relative, gain[usable])
    unit = "J" if evidence.energy_in_joule else "relative"
    systematic = math.hypot(
        float(np.median([evidence.shot_systematic[index] for index in usable])),
        evidence.setup.energy_scale_stderr,
    )
    figures.append(
        Figure("energy per event", nowhere, event.energy, event.stderr, event.energy * systematic, unit)
    )
    photon = evidence.setup.photon_energy
    if not evidence.energy_in_joule or math.isnan(photon) or event.energy <= 0.0:
        return figures
    efficiency = photon / event.energy
    error = efficiency * event.stderr / event.energy
    shared = efficiency * systematic
    setup = evidence.setup
    if not setup.intensified:
        return [*figures, Figure("quantum efficiency QE", nowhere, efficiency, error, shared, "1")]
    figures.append(Figure("QE/F² (excess noise not separable)", nowhere, efficiency, error, shared, "1"))
    if setup.excess_noise is not None:
        factor = setup.excess_noise
        shared = factor * efficiency * math.hypot(systematic, setup.excess_noise_stderr / factor)
        figures.append(
            Figure("QE with the stated F²", nowhere, factor * efficiency, factor * error, shared, "1")
        )
    return figures


def linearity_error(counts: Floats, energy: Floats) -> tuple[float, float]:
    """Linearity error after EMVA 1288 release 4 Linear: mean relative deviation from the straight line.

    The line is fitted with weights 1/counts^2 between 5 and 95 % of the largest counts.

    Returns
    -------
    value, stderr
        Fractions; NaN with fewer than three points.
    """
    inside = (counts >= 0.05 * counts.max()) & (counts <= 0.95 * counts.max())
    if inside.sum() < 3:
        return math.nan, math.nan
    at, measured = energy[inside] / energy[inside].max(), counts[inside]
    design = np.stack([np.ones(at.size), at], axis=1) / measured[:, None]
    line, *_ = np.linalg.lstsq(design, np.ones(at.size), rcond=None)
    deviation = np.abs(measured - (line[0] + line[1] * at)) / (line[0] + line[1] * at)
    return float(deviation.mean()), float(deviation.std(ddof=1) / math.sqrt(at.size))
