"""From a folder of frames to a calibration: read in stages, then everything solved together."""

from __future__ import annotations

import datetime
import math
import platform
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration import frames
from calibration.curve import Response
from calibration.folder import Series, read_folder
from calibration.levels import Levels
from calibration.merit import Evidence, figures_of_merit, linearity_error
from calibration.model import Calibration
from calibration.noise import Transfer
from calibration.reader import Progress, Reader
from calibration.response import JointFit, fit_jointly
from calibration.runs import Run, clipped, faults_of_runs, levels_of, reference_of, saturation_of, usable
from calibration.setting import Setting
from calibration.stages import DarkField, FlatField, dark_fields, flat_fields, light_runs
from calibration.transfer import transfers_of

Floats = NDArray[np.float64]

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
    solved = _solve(runs, darks, reader, saturation=saturation, good=good)
    fit, response = solved.fit, solved.response
    flat_maps = {gain: _sensitivity(field, response, typical, good) for gain, field in flats.items()}
    transfers, systematic = transfers_of(
        solved.runs, darks, reader, fit=fit, response=response, saturation=saturation
    )
    evidence = Evidence(
        setup=series.setup,
        response=response,
        gains=series.settings,
        log_gain=fit.log_gain,
        log_gain_stderr=np.sqrt(np.diag(fit.covariance)[fit.log_counts.size :]).tolist(),
        transfers=transfers,
        shot_systematic=systematic,
        darks=darks,
        flats=flats,
        defects=defects,
        saturation_counts=saturation,
        energy_in_joule=series.energy_unit == "J",
        linearity=_linearity(solved.used, solved.reference),
    )
    return Calibration(
        setup=series.setup,
        response=response,
        gains=series.settings,
        reference_gain=solved.reference,
        log_gain=fit.log_gain,
        covariance=fit.covariance,
        settings=_settings(series, darks, flats, flat_maps, transfers),
        defects=defects,
        saturation_counts=saturation,
        unit=series.energy_unit,
        figures=figures_of_merit(evidence),
        tables=_tables(solved, saturation),
        notes=tuple(dict.fromkeys([*reader.notes, *fit.notes])),
        provenance=_provenance(series),
    )


class _Solved(NamedTuple):
    """The joint fit with the runs it came from, their means set straight."""

    fit: JointFit
    response: Response
    reference: float
    used: list[Run]
    runs: list[Run]


def _solve(
    runs: list[Run],
    darks: Mapping[float, DarkField],
    reader: Reader,
    *,
    saturation: float,
    good: NDArray[np.bool_],
) -> _Solved:
    """Solve response and gains from the runs that can be used."""
    chosen = usable(runs, saturation)
    reference = reference_of(chosen, reader.series)
    lowest_dark = min(float(np.median(field.picture[good])) for field in darks.values())
    to_levels = partial(
        levels_of,
        series=reader.series,
        reference=reference,
        dark_variance={gain: field.statistics.variance for gain, field in darks.items()},
        saturation_above_dark=saturation - lowest_dark,
    )
    fit, used = _fit_without_outliers(chosen, to_levels, reader)
    straight = {run.where: run for run in used}
    runs = [straight.get(run.where, run) for run in runs]
    return _Solved(fit, _response(fit, used, saturation - lowest_dark), reference, used, runs)


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


def _tables(solved: _Solved, saturation: float) -> Mapping[str, Any]:
    fit, runs = solved.fit, solved.runs
    place = {run.where: index for index, run in enumerate(solved.used)}
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
