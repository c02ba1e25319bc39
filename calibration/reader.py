"""Reads the runs of a checked folder picture by picture; what is wrong with a picture becomes a fault."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration import frames
from calibration.errors import Fault, FolderError
from calibration.folder import Row, Series
from calibration.tally import Region, Tally

Progress = Callable[[str], None]


class Reader:
    """The pictures of a folder in raw counts, with the faults and notes gathered on the way."""

    def __init__(self, series: Series, progress: Progress) -> None:
        self.series = series
        self.faults: list[Fault] = []
        self.notes: list[str] = list(series.notes)
        self._progress = progress
        self._total = sum(row.pictures for row in series.rows)
        self._done = 0
        self._shift = _left_alignment(series)
        if self._shift:
            self.notes.append(
                f"the {series.setup.bit_depth} bits stand at the left of 16: "
                f"counts were divided by {2**self._shift}"
            )

    def stop_if_faulty(self) -> None:
        """Raise all faults found so far together."""
        if self.faults:
            raise FolderError(str(self.series.folder), self.faults)

    def pictures(self, rows: Sequence[Row], *, skip: Sequence[int] = ()) -> Iterator[NDArray[np.generic]]:
        """Yield the pictures of a run, without those whose number in the run is in ``skip``."""
        number = -1
        for row in rows:
            where = f"{row.where} ({row.path.name})"
            try:
                for picture in frames.pictures(row.path):
                    number += 1
                    self._done = min(self._done + 1, self._total)
                    self._progress(f"reading frame {self._done} of {self._total}")
                    counts = self._checked(picture, where)
                    if counts is not None and number not in skip:
                        yield counts
            except frames.UnreadableFrameError as error:
                self.faults.append(Fault(where, str(error), "a whole frame file"))

    def _checked(self, picture: NDArray[Any], where: str) -> NDArray[np.generic] | None:
        if picture.dtype.kind == "f":
            if not np.isfinite(picture).all():
                self.faults.append(Fault(where, "NaN or infinite values", "counts in every pixel"))
                return None
        elif self._shift:
            picture = picture >> self._shift
        full_scale = self.series.setup.full_scale
        if picture.max() > full_scale:
            wanted = f"at most {full_scale} with bit_depth = {self.series.setup.bit_depth}"
            self.faults.append(Fault(where, f"counts up to {picture.max()}", wanted))
            return None
        return picture

    def gather(self, rows: Sequence[Row], region: Region, **options: Any) -> Tally | None:
        """Tally a run; where a mean picture is kept, once more without its outlier frames."""
        tally = Tally(region, **options)
        for picture in self.pictures(rows):
            tally.add(picture)
        if not tally.count:
            return None
        outliers = tally.statistics().outliers
        if outliers:
            listed = ", ".join(str(index + 1) for index in outliers)
            self.notes.append(f"{rows[0].where}: frames of this run left out as outliers: {listed}")
            if options.get("keep_mean"):
                tally = Tally(region, **options)
                for picture in self.pictures(rows, skip=outliers):
                    tally.add(picture)
        return tally


def _left_alignment(series: Series) -> int:
    """Bits to shift right where fewer than 16 bits were stored at the left of 16-bit words, else 0."""
    spare = 16 - series.setup.bit_depth
    if not spare:
        return 0
    for row in sorted(series.rows, key=lambda row: -np.nan_to_num(row.energy))[:3]:
        try:
            picture: NDArray[Any] = next(frames.pictures(row.path))
        except (frames.UnreadableFrameError, StopIteration):
            continue
        if picture.dtype != np.uint16 or np.any(picture & np.uint16(2**spare - 1)):
            return 0
        if picture.max() > series.setup.full_scale:
            return spare
    return 0
