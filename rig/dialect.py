"""What a generator's language is made of: properties on grids, and the lines that set and ask them.

A dialect only translates; it sends nothing. Values have a *native* form that compares exactly (whole
picoseconds, millivolts, microhertz, counts, names) and a *shown* form for people and files.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple, Protocol

from rig.errors import Fault, PlanError, ReplyError
from rig.models import Model
from rig.quantity import Quantity, decimal_text, exact, nearest

Native = Any
"""int, str, bool or a tuple of them: compared with ``==`` and never rounded."""


class Line(NamedTuple):
    """One line to send and the pattern its whole reply must match; None where none comes."""

    text: str
    reply: re.Pattern[str] | None


class Domain(Protocol):
    """The values that a property takes."""

    @property
    def unit(self) -> str:
        """What a shown number counts; empty for names."""

    def native(self, value: Any, where: str) -> Native:
        """Turn what a user gives into the native form, or refuse it."""

    def shown(self, native: Native) -> Any:
        """Turn the native form into what people and files get."""


@dataclass(frozen=True)
class Steps:
    """Whole steps between two ends, counted in ``unit`` (``per_si`` of them in the SI unit)."""

    kind: str
    unit: str
    per_si: int
    step: int
    lowest: int
    highest: int

    def native(self, value: Quantity, where: str) -> int:
        """Return the nearest step; outside the range is refused, never clamped."""
        exact_units = exact(value, self.kind, name=where) * self.per_si
        if not self.lowest <= exact_units <= self.highest:
            wanted = f"{self.lowest} to {self.highest} {self.unit} in steps of {self.step}".replace("  ", " ")
            came = f"{value!r} = {float(exact_units):.17g} {self.unit}".rstrip()
            raise PlanError(where, [Fault(where, came, wanted)])
        return nearest(exact_units, self.step) * self.step

    def shown(self, native: int) -> int:
        """Return the count of units."""
        return native

    def text(self, native: int, decimals: int) -> str:
        """Write the value in SI with fixed decimals."""
        return decimal_text(Fraction(native, self.per_si), decimals)

    def parse(self, reply: str) -> int:
        """Read an SI decimal as a count of units, to the last digit."""
        units = Fraction(reply) * self.per_si
        if units.denominator != 1:
            raise ReplyError(
                f"reply {reply!r}: finer than {self.unit}; wanted steps of {self.step} {self.unit}"
            )
        return int(units)


@dataclass(frozen=True)
class Names:
    """A closed list of names and what each is on the wire."""

    wire: Mapping[str, str]
    unit: str = ""

    def native(self, value: Any, where: str) -> str:
        """Return the name itself, or refuse it."""
        name = str(value).strip().lower() if str(value).strip().lower() in self.wire else str(value).strip()
        if name not in self.wire:
            raise PlanError(where, [Fault(where, repr(value), f"one of {', '.join(self.wire)}")])
        return name

    def shown(self, native: str) -> str:
        """Return the name."""
        return native

    def parse(self, reply: str) -> str:
        """Return the name of what the box answered."""
        for name, wire in self.wire.items():
            if wire == reply:
                return name
        raise ReplyError(f"reply {reply!r}: wanted one of {', '.join(self.wire.values())}")


@dataclass(frozen=True)
class Switch:
    """On or off."""

    unit: str = ""

    def native(self, value: Any, where: str) -> bool:
        """Return True or False for a bool, ``"on"``/``"off"``, 0 or 1."""
        text = str(value).strip().lower()
        if text in ("true", "on", "1"):
            return True
        if text in ("false", "off", "0"):
            return False
        raise PlanError(where, [Fault(where, repr(value), "on or off")])

    def shown(self, native: bool) -> bool:
        """Return the flag."""
        return native

    def parse(self, reply: str) -> bool:
        """Return True for 1."""
        return reply == "1"


@dataclass(frozen=True)
class Property:
    """One setting of one output (or of the whole box): its values, and its lines."""

    name: str
    output: str | None
    domain: Domain
    queries: tuple[Line, ...]
    commands: Callable[[Native], tuple[str, ...]]
    parse: Callable[[Sequence[str]], Native]

    @property
    def where(self) -> str:
        """How messages call it."""
        return self.name if self.output is None else f"{self.output}.{self.name}"

    @property
    def key(self) -> str:
        """The name with its unit, for tables and files."""
        return f"{self.name}_{self.domain.unit}" if self.domain.unit else self.name


class Identity(NamedTuple):
    """Who answered ``*IDN?``."""

    maker: str
    model: str
    serial: str
    firmware: str
    text: str


class Step(NamedTuple):
    """One setting to make."""

    name: str
    output: str | None
    value: Any


class Dialect(Protocol):
    """A family of generators, as far as their words differ.

    ``stacked`` says whether several lines may go out before the first reply comes; ``acknowledgement``
    what every set is answered with, ``error_query`` what asks for errors where sets are not answered.
    """

    model: Model
    terminator: str
    stacked: bool
    acknowledgement: re.Pattern[str] | None
    error_query: Line | None
    system_properties: tuple[str, ...]
    output_properties: tuple[str, ...]

    def identity(self, reply: str) -> Identity | None:
        """Read the reply to ``*IDN?``, or None if it is no box of this family."""

    def output_named(self, name: str) -> str:
        """Return the output called ``name``, or refuse."""

    def property(self, name: str, output: str | None) -> Property:
        """Return one property with its lines."""

    def meaning_of_error(self, code: str) -> str:
        """Return the maker's words for an error."""

    def opening_lines(self) -> tuple[str, ...]:
        """Return what a session that writes sends first."""

    def gate_steps(self, output: str, delay_ps: int, width_ps: int) -> tuple[Step, ...]:
        """Return the order of settings that cannot widen the gate on the way."""

    def safe_steps(self, output: str) -> tuple[Step, ...]:
        """Return what makes the box safe, the trigger first."""

    def conflicts(self, settings: Mapping[str, Any], output: str, first_ps: int, last_ps: int) -> list[Fault]:
        """Return what moving the gate between two delays would break on other outputs."""

    def save_line(self, slot: int) -> str:
        """Return the line that stores all settings."""

    def recall_lines(self, slot: int) -> tuple[str, ...]:
        """Return the lines that recall settings and stop the triggers at once."""


def unknown_property(name: str, known: Sequence[str], model: Model) -> PlanError:
    """Return the refusal of a property that the model does not have."""
    fault = Fault("property", repr(name), f"one of {', '.join(known)}", f"The {model.name} has no other.")
    return PlanError("property", [fault])
