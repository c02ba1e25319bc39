"""Photon transfer of every setting, and what the response's own error adds to it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from calibration.curve import Response
from calibration.noise import Transfer, TransferPoints, fit_transfer
from calibration.reader import Reader
from calibration.response import JointFit, rising
from calibration.runs import Run, clipped
from calibration.stages import DarkField
from calibration.tally import LAG_REACH

RESPONSE_DRAWS = 24
BENT_NOISE = 8e-3  # relative: what photon transfer is off by through a bent response (measured)


def transfers_of(
    runs: Sequence[Run],
    darks: Mapping[float, DarkField],
    reader: Reader,
    *,
    fit: JointFit,
    response: Response,
    saturation: float,
) -> tuple[list[Transfer], list[float]]:
    """Photon transfer of every setting, and the relative error that the response's own error adds."""
    draws = _drawn_responses(fit, response)
    transfers, systematic = [], []
    for gain in reader.series.settings:
        members = [
            run
            for run in runs
            if run.key.gain == gain
            and not clipped(run, saturation)
            and np.isfinite(run.statistics.variance)
            and response.lowest <= run.statistics.mean <= response.highest
        ]
        if not members:
            reader.notes.append(
                f"gain {gain:g}: no run with two frames between dark and saturation: no photon transfer"
            )
        found = fit_transfer(_points(members, darks[gain], response))
        transfers.append(found)
        shots = (
            [fit_transfer(_points(members, darks[gain], draw)).shot for draw in draws] if members else [0.0]
        )
        bent = BENT_NOISE if _is_bent(response) else 0.0
        systematic.append(math.hypot(np.std(shots) / found.shot, bent) if found.shot > 0.0 else math.nan)
        if found.outliers:
            few = ", ".join(members[index].where for index in found.outliers[:3])
            named = f"{few}{', ...' if len(found.outliers) > 3 else ''}"
            reader.notes.append(
                f"gain {gain:g}: the noise of {len(found.outliers)} of {len(members)} runs does not fit "
                f"photon transfer; little weight was given to them ({named})"
            )
    return transfers, systematic


def _is_bent(response: Response) -> bool:
    """Whether the response departs from a straight line through the origin by more than 2 % somewhere."""
    share = response.exposure(np.exp(response.log_counts)) / np.exp(response.log_counts)
    return bool(share.max() > 1.02 * share.min())


def _drawn_responses(fit: JointFit, response: Response) -> list[Response]:
    rng = np.random.default_rng(20210616)
    nodes = fit.log_counts.size
    values, vectors = np.linalg.eigh(fit.covariance[:nodes, :nodes])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return [
        replace(response, log_exposure=rising(fit.log_exposure + root @ rng.standard_normal(nodes)))
        for _ in range(RESPONSE_DRAWS)
    ]


def _points(members: Sequence[Run], dark: DarkField, response: Response) -> TransferPoints:
    counts = np.array([run.statistics.mean for run in members])
    found = [run.statistics for run in members]
    noise = np.sqrt([max(item.variance, 0.0) for item in found])
    dark_variance = dark.statistics.variance
    if not math.isfinite(dark_variance):
        dark_variance, dark_error = 1.0 / 12.0, 1.0
    else:
        dark_error = dark.statistics.variance_stderr
    size = 2 * LAG_REACH + 1
    return TransferPoints(
        variance=np.array([item.variance for item in found]),
        variance_stderr=np.array([item.variance_stderr for item in found]),
        lever=response.exposure(counts) / response.secant(counts, noise) ** 2,
        lags=np.array([item.lags for item in found]).reshape(-1, size, size),
        pixels=np.array([item.lag_count * item.pixels for item in found], dtype=np.float64),
        dark_variance=dark_variance,
        dark_variance_stderr=dark_error,
        dark_lags=dark.statistics.lags,
    )
