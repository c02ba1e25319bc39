"""From a folder of frames to a calibration: read in stages, then everything solved together."""

from __future__ import annotations

import datetime
import math
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration import frames
from calibration.curve import Response
from calibration.folder import Series, read_folder
from calibration.levels import Levels
from calibration.merit import Evidence, figures_of_merit, linearity_error
from calibration.model import Calibration
from calibration.noise import Transfer, TransferPoints, fit_transfer
from calibration.reader import Progress, Reader
from calibration.response import JointFit, fit_jointly, rising
from calibration.runs import Run, clipped, faults_of_runs, levels_of, reference_of, saturation_of, usable
from calibration.setting import Setting
from calibration.stages import DarkField, FlatField, dark_fields, flat_fields, light_runs
from calibration.tally import LAG_REACH

Floats = NDArray[np.float64]

RESPONSE_DRAWS = 24
BENT_NOISE = 8e-3  # relative: what photon transfer is off by through a bent response (measured)
RANGE_SIGMAS = 4.0  # how far the noise of the brightest level reaches: counts seen, not extrapolated
OUTLIER_SIGMAS = 5.0


def calibrate(
    folder: str | Path, *, pattern: str | None = None, progress: Progress | None = None
) -> Calibration:
    """Calibrate a camera from a folder of frames.

    Parameters
    ----------
    folder : path
        Frames, ``frames.csv`` and ``camera.toml`` (see ``docs/calibrate.md``).
    pattern : str, optional
        How the files are named, in place of ``frames.csv``:
        ``"{kind}/gain{gain}_E{energy_J}_*.tif"``.
    progress : callable, optional
        Told in a few words what is being done.

    Returns
    -------
    Calibration
        Response, gain, noise and pixel maps with their uncertainties.

    Raises
    ------
    FolderError
        With every fault found: unreadable or mismatched files, negative energies, levels that do
        not rise, settings without overlap, nothing but saturation.
    """
    series = read_folder(folder, pattern=pattern)
    reader = Reader(series, progress or (lambda text: None))
    darks, defects = dark_fields(reader)
    flats, typical, runs = flat_fields(reader, darks, defects)
    runs = runs + light_runs(reader, darks, typical)
    saturation = saturation_of(runs, series.setup)
    reader.faults += faults_of_runs(runs, series, saturation)
    reader.stop_if_faulty()
    if progress:
        progress("solving response, gain and noise")
    good = defects == 0
    lowest_dark = min(float(np.median(field.picture[good])) for field in darks.values())
    dark_variance = {gain: field.statistics.variance for gain, field in darks.items()}
    fit, used = _fit_without_outliers(
        usable(runs, saturation),
        lambda chosen: levels_of(
            chosen, series, dark_variance=dark_variance, saturation_above_dark=saturation - lowest_dark
        ),
        reader,
    )
    straightened = {run.where: run for run in used}
    runs = [straightened.get(run.where, run) for run in runs]
    response = _response(fit, used, saturation - lowest_dark)
    flat_maps = {gain: _sensitivity(field, response, typical, good) for gain, field in flats.items()}
    transfers, systematic = _transfers(series, runs, darks, fit, response, saturation, reader)
    reference = reference_of(used, series)
    nodes = fit.log_counts.size
    evidence = Evidence(
        setup=series.setup,
        response=response,
        gains=series.settings,
        log_gain=fit.log_gain,
        log_gain_stderr=np.sqrt(np.diag(fit.covariance)[nodes:]).tolist(),
        transfers=transfers,
        shot_systematic=systematic,
        darks=darks,
        flats=flats,
        defects=defects,
        saturation_counts=saturation,
        energy_in_joule=series.energy_unit == "J",
        linearity=_linearity(used, reference),
    )
    return Calibration(
        setup=series.setup,
        response=response,
        gains=series.settings,
        reference_gain=reference,
        log_gain=fit.log_gain,
        covariance=fit.covariance,
        settings=_settings(series, darks, flats, flat_maps, transfers),
        defects=defects,
        saturation_counts=saturation,
        unit=series.energy_unit,
        figures=figures_of_merit(evidence),
        tables=_tables(runs, used, fit, saturation),
        notes=tuple(dict.fromkeys([*reader.notes, *fit.notes])),
        provenance=_provenance(series),
    )


def _fit_without_outliers(
    runs: Sequence[Run], levels: Callable[[Sequence[Run]], Levels], reader: Reader
) -> tuple[JointFit, list[Run]]:
    """Solve; leave out runs that no error of their size explains, one at a time, and say so."""
    used = list(runs)
    allowed = len(used) // 20
    while True:
        fit = fit_jointly(levels(used))
        strange = np.nan_to_num(np.abs(fit.residual) / fit.scatter)
        worst = int(np.argmax(strange))
        if strange[worst] < OUTLIER_SIGMAS or not allowed:
            return fit, [run.with_mean(float(mean)) for run, mean in zip(used, fit.counts, strict=True)]
        allowed -= 1
        reader.notes.append(
            f"{used[worst].where}: this run lies {strange[worst]:.1f} standard errors off the "
            "others; it was left out of the response"
        )
        del used[worst]


def _response(fit: JointFit, used: Sequence[Run], saturation_above_dark: float) -> Response:
    brightest = max(used, key=lambda run: run.statistics.mean)
    noise = math.sqrt(max(np.nan_to_num(brightest.statistics.variance), 0.0))
    limit = min(brightest.statistics.mean + RANGE_SIGMAS * noise, saturation_above_dark)
    return Response(fit.log_counts, fit.log_exposure, max(limit, brightest.statistics.mean))


def _sensitivity(
    field: FlatField, response: Response, typical: NDArray[np.bool_], good: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Relative sensitivity of each pixel; 1 for the typical pixel, and where a bad one has none."""
    exposure = response.exposure(np.minimum(field.picture.astype(np.float64), response.limit))
    relative = exposure / float(exposure[typical].mean())
    return np.where(good & (relative > 0.0), relative, 1.0).astype(np.float32)


def _transfers(
    series: Series,
    runs: Sequence[Run],
    darks: Mapping[float, DarkField],
    fit: JointFit,
    response: Response,
    saturation: float,
    reader: Reader,
) -> tuple[list[Transfer], list[float]]:
    """Photon transfer of every setting, and the relative error that the response's own error adds."""
    draws = _drawn_responses(fit, response)
    transfers, systematic = [], []
    for gain in series.settings:
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


def _settings(
    series: Series,
    darks: Mapping[float, DarkField],
    flats: Mapping[float, FlatField],
    flat_maps: Mapping[float, NDArray[np.float32]],
    transfers: Sequence[Transfer],
) -> tuple[Setting, ...]:
    even = np.ones(series.shape, dtype=np.float32)
    settings = []
    for gain, transfer in zip(series.settings, transfers, strict=True):
        flat_stderr = flats[gain].relative_noise if gain in flats else 0.0
        settings.append(
            Setting(
                dark=darks[gain].picture,
                flat=flat_maps.get(gain, even),
                dark_stderr=math.sqrt(transfer.read_variance / darks[gain].statistics.frames),
                flat_stderr=flat_stderr,
                read_variance=transfer.read_variance,
                shot=transfer.shot,
                correlation=transfer.correlation,
            )
        )
    return tuple(settings)


def _linearity(used: Sequence[Run], reference: float) -> tuple[float, float]:
    points = [
        (run.statistics.mean, run.key.energy)
        for run in used
        if run.key.gain == reference and run.key.energy is not None
    ]
    if not points:
        return math.nan, math.nan
    counts, energy = np.array(points).T
    return linearity_error(counts, energy)


def _tables(runs: Sequence[Run], used: Sequence[Run], fit: JointFit, saturation: float) -> Mapping[str, Any]:
    place = {run.where: index for index, run in enumerate(used)}
    inside = [place.get(run.where, -1) for run in runs]
    residual = np.append(fit.residual, math.nan)
    scatter = np.append(fit.scatter, math.nan)
    found = [run.statistics for run in runs]
    return {
        "gain": np.array([run.key.gain for run in runs]),
        "energy": np.array([math.nan if run.key.energy is None else run.key.energy for run in runs]),
        "frames": np.array([item.frames for item in found]),
        "counts": np.array([item.mean for item in found]),
        "counts_stderr": np.array([item.mean_stderr for item in found]),
        "variance": np.array([item.variance for item in found]),
        "variance_stderr": np.array([item.variance_stderr for item in found]),
        "residual": residual[inside],
        "residual_scatter": scatter[inside],
        "clipped": np.array([clipped(run, saturation) for run in runs]),
    }


def _provenance(series: Series) -> Mapping[str, Any]:
    versions = {name: metadata.version(name) for name in ("numpy", "scipy", "h5py", "tifffile")}
    return {
        "folder": series.folder.name,
        "made": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "python": platform.python_version(),
        "versions": versions,
        "frames": {str(row.path.relative_to(series.folder)): frames.digest(row.path) for row in series.rows},
    }
