"""The errors of the rig: one small family, each also a fitting built-in.

``exit_code`` is what a command line ends with: 2 for input that the user can mend, 3 for hardware.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """One thing wrong: where it is, what came, what was wanted, what to do."""

    where: str
    came: str
    wanted: str
    advice: str = ""

    def __str__(self) -> str:
        text = f"{self.where}: got {self.came}; wanted {self.wanted}"
        return f"{text}. {self.advice}" if self.advice else text


class RigError(Exception):
    """Base of every error that the rig raises on purpose."""

    exit_code = 3


class PlanError(RigError, ValueError):
    """A plan or setting that cannot be, told before any byte is sent.

    Parameters
    ----------
    source : str
        What was asked for: a plan, a file, a setting.
    faults : iterable of Fault
        All that is wrong with it.
    """

    exit_code = 2

    def __init__(self, source: str, faults: Iterable[Fault]) -> None:
        self.source = source
        self.faults = tuple(faults)
        super().__init__("\n".join([f"{source} refused", *(f"  {fault}" for fault in self.faults)]))


class LimitError(PlanError):
    """A plan or setting that the limits file forbids."""


class LinkError(RigError, OSError):
    """The port cannot be opened, went away, or the generator does not answer."""


class OwnedError(LinkError):
    """Another program or thread owns the port."""


class ReplyError(RigError, ValueError):
    """A reply that is late, cut, garbled, or belongs to another question."""


class InstrumentError(RigError, RuntimeError):
    """The generator itself reported an error."""


class ReadBackError(RigError, RuntimeError):
    """The generator holds something else than what was sent."""


class NotConfirmedSafeError(RigError, RuntimeError):
    """The safe state was asked for and could not be read back."""
