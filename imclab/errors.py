"""The errors of imclab: one small family, each also a fitting built-in.

``exit_code`` is what the command line ends with: 2 for input that the user can mend, 3 for
hardware. The packages ``rig`` and ``calibration`` give their own errors the same attribute, so the
command line needs to import neither to tell them from a fault of the program.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """One thing wrong with an input: where it is, what came, what was wanted, what to do."""

    where: str
    came: str
    wanted: str
    advice: str = ""

    def __str__(self) -> str:
        text = f"{self.where}: got {self.came}; wanted {self.wanted}"
        return f"{text}. {self.advice}" if self.advice else text


class ImclabError(Exception):
    """Base of every error that imclab raises on purpose."""

    exit_code = 2


class InputError(ImclabError, ValueError):
    """One or several faults of an input, told together.

    Parameters
    ----------
    source : str
        What was read: a file, a folder, an argument.
    faults : iterable of Fault
        All that is wrong with it.
    """

    def __init__(self, source: str, faults: Iterable[Fault]) -> None:
        self.source = source
        self.faults = tuple(faults)
        count = len(self.faults)
        head = f"{source}: {count} fault{'s' if count != 1 else ''}"
        super().__init__("\n".join([head, *(f"  {fault}" for fault in self.faults)]))


class OutputError(ImclabError, OSError):
    """A result could not be written."""


class InterruptedRunError(ImclabError):
    """The user stopped a run; what was finished has been saved."""

    exit_code = 130
