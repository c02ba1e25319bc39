"""The stages of reading a calibration folder: dark frames, flat frames, frames of light."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from calibration.correct import Defect, blinking_pixels, dead_pixels, hot_pixels, typical_pixels
from calibration.folder import Row
from calibration.reader import Reader
from calibration.runs import CLIPPED_SHARE, Run, grouped
from calibration.tally import Map, Region, RunStatistics

Kept = TypeVar("Kept")


@dataclass(frozen=True)
class DarkField:
    """Dark frames of one setting: mean picture and statistics."""

    picture: Map
    statistics: RunStatistics

    @property
    def drift(self) -> float:
        """Counts that the dark level moved from the first to the last frame (straight line)."""
        means = self.statistics.frame_means
        if means.size < 3:
            return 0.0
        return float(np.polyfit(np.linspace(0.0, 1.0, means.size), means, 1)[0])


@dataclass(frozen=True)
class FlatField:
    """Flat frames of one setting: mean picture above dark, its run, and its noise per pixel."""

    picture: Map
    run: Run

    @property
    def relative_noise(self) -> float:
        """Temporal noise left in one pixel of the mean picture, relative to the mean."""
        found = self.run.statistics
        return float(np.sqrt(max(np.nan_to_num(found.variance), 0.0) / found.frames) / max(found.mean, 1e-9))


def dark_fields(reader: Reader) -> tuple[dict[float, DarkField], NDArray[np.uint8]]:
    """Sum up the dark frames of every setting and find hot and blinking pixels."""
    shape = reader.series.shape
    region = Region(np.ones(shape, dtype=np.bool_))
    defects = np.zeros(shape, dtype=np.uint8)
    fields: dict[float, DarkField] = {}
    most_frames = 0
    groups: dict[float, list[Row]] = {}
    for row in reader.series.rows:
        if row.kind == "dark":
            groups.setdefault(row.gain, []).append(row)
    for gain, rows in groups.items():
        tally = reader.gather(rows, region, keep_mean=True, keep_noise=True)
        if tally is None:
            continue
        found = tally.statistics()
        blinking = blinking_pixels(tally.noise_map(trimmed=True), jumps=found.frames - 1)
        if found.frames > 1:
            found = found.with_variance(*Region(~blinking).mean_with_stderr(tally.noise_map(trimmed=False)))
        fields[gain] = DarkField(tally.mean_map(), found)
        noise = np.sqrt(np.nan_to_num(found.variance, nan=1.0) / found.frames)
        defects[blinking] |= np.uint8(Defect.BLINKING)
        defects[hot_pixels(fields[gain].picture, mean_stderr=float(noise)) & ~blinking] |= np.uint8(
            Defect.HOT
        )
        most_frames = max(most_frames, found.frames)
        if found.share_at_zero > CLIPPED_SHARE:
            reader.notes.append(
                f"{rows[0].where}: {found.share_at_zero:.1%} of the dark pixels read 0: the black level is "
                "cut off, dark level and dark noise are wrong there; raise the camera's offset"
            )
    if most_frames and most_frames < 6:
        reader.notes.append("blinking pixels cannot be told: that takes 6 or more dark frames at a setting")
    reader.stop_if_faulty()
    return _for_every_setting(fields, reader, "dark"), defects


def flat_fields(
    reader: Reader, darks: Mapping[float, DarkField], defects: NDArray[np.uint8]
) -> tuple[dict[float, FlatField], NDArray[np.bool_], list[Run]]:
    """Sum up the flat frames, find dead pixels and the typical ones.

    The best exposed run of each setting is its flat. The typical pixels, over which all light is
    averaged, are the same at every setting (from the least noisy flat): else the gain would be
    compared between different pixels.
    """
    fields: dict[float, FlatField] = {}
    runs = []
    middle = 0.5 * reader.series.setup.full_scale
    region = Region(defects == 0)
    for key, rows in grouped(reader.series.rows, kinds=("flat",)).items():
        tally = reader.gather(rows, region, dark=darks[key.gain].picture, keep_mean=True)
        if tally is None:
            continue
        run = Run(key, tuple(rows), tally.statistics())
        runs.append(run)
        before = fields.get(key.gain)
        if before is None or abs(run.statistics.mean - middle) < abs(before.run.statistics.mean - middle):
            fields[key.gain] = FlatField(tally.mean_map(), run)
    reader.stop_if_faulty()
    for field in fields.values():
        if field.run.statistics.mean > 0.0:
            defects[dead_pixels(field.picture)] |= np.uint8(Defect.DEAD)
    if not fields:
        reader.notes.append(
            "no flat frames: all pixels are taken as equally sensitive, dead ones are not found"
        )
        return {}, defects == 0, runs
    best = min(fields.values(), key=lambda field: field.relative_noise)
    typical = typical_pixels(best.picture, defects == 0)
    kept = {field.run.where: field for field in fields.values()}
    runs = [
        run.with_mean(float(kept[run.where].picture[typical].mean(dtype=np.float64)))
        for run in runs
        if run.where in kept
    ]
    return _for_every_setting(fields, reader, "flat"), typical, runs


def light_runs(reader: Reader, darks: Mapping[float, DarkField], typical: NDArray[np.bool_]) -> list[Run]:
    """Sum up the response and gain frames over the typical pixels."""
    region = Region(typical)
    runs = []
    for key, rows in grouped(reader.series.rows, kinds=("response", "gain")).items():
        tally = reader.gather(rows, region, dark=darks[key.gain].picture)
        if tally is not None:
            runs.append(Run(key, tuple(rows), tally.statistics()))
    reader.stop_if_faulty()
    return runs


def _for_every_setting(taken: dict[float, Kept], reader: Reader, what: str) -> dict[float, Kept]:
    """Fill settings without frames of their own from the frames for any setting, or the nearest one's."""
    anywhere = next((kept for gain, kept in taken.items() if np.isnan(gain)), None)
    filled = {}
    for gain in reader.series.settings:
        if gain in taken:
            filled[gain] = taken[gain]
        elif anywhere is not None:
            filled[gain] = anywhere
        else:
            nearest = min(taken, key=lambda other: abs(other - gain))
            filled[gain] = taken[nearest]
            reader.notes.append(
                f"gain {gain:g}: no {what} frames of its own; those of gain {nearest:g} are used"
            )
    return filled
