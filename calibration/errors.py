"""The errors of calibration: one small family, each also a fitting built-in, all with an exit code."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches


@dataclass(frozen=True)
class Fault:
    """One thing wrong with the input: where it is, what came, what was wanted, what to do."""

    where: str
    came: str
    wanted: str
    advice: str = ""

    def __str__(self) -> str:
        text = f"{self.where}: got {self.came}; wanted {self.wanted}"
        return f"{text}. {self.advice}" if self.advice else text


class CalibrationError(Exception):
    """Base of every error that calibration raises on purpose."""

    exit_code = 2


class FolderError(CalibrationError, ValueError):
    """A calibration folder that cannot be used; every fault found is in ``faults``."""

    def __init__(self, source: str, faults: Iterable[Fault]) -> None:
        self.source = source
        self.faults = tuple(faults)
        count = len(self.faults)
        head = f"{source}: {count} fault{'s' if count != 1 else ''}"
        super().__init__("\n".join([head, *(f"  {fault}" for fault in self.faults)]))


class SettingError(CalibrationError, LookupError):
    """A gain setting that was not calibrated and may not be interpolated."""

    def __str__(self) -> str:
        return str(self.args[0])


class ShapeError(CalibrationError, ValueError):
    """A frame whose size or type does not fit the calibrated sensor."""


class StoredFileError(CalibrationError, ValueError):
    """A file that is not a whole calibration."""


def nearest(word: str, known: Sequence[str]) -> str:
    """Give the advice ``did you mean ...?``, or the list of known words when none is close."""
    close = get_close_matches(word, known, n=1, cutoff=0.6)
    return f"Did you mean {close[0]!r}?" if close else f"Known: {', '.join(known)}."
