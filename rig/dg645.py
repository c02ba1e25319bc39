"""The language of the Stanford Research Systems DG645 (Operation and Service Manual rev. 1.1, p. 44-67).

A set is answered by silence: errors wait in a queue (``LERR?``). Edges count T0 0, T1 1, A..H 2..9;
outputs T0 0, AB 1, CD 2, EF 3, GH 4. Output AB rises at A and falls at B. Delays have steps of 5 ps.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

from rig.dialect import Identity, Line, Names, Property, Step, Steps, Switch, unknown_property
from rig.errors import Fault, ReplyError
from rig.models import MODELS, output_named
from rig.quantity import Quantity

_EDGES = ("T0", "T1", "A", "B", "C", "D", "E", "F", "G", "H")
_OUTPUTS = {"T0": 0, "AB": 1, "CD": 2, "EF": 3, "GH": 4}
_TIME = Steps("time", "ps", 10**12, 5, 0, 1_999_999_999_999_995)
_WIDTH = Steps("time", "ps", 10**12, 5, MODELS["dg645"].shortest_width_ps, _TIME.highest)
_DELAY_REPLY = re.compile(r"([0-9]),([+-]\d{1,4}\.\d{12})")
_NUMBER_REPLY = re.compile(r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
_DIGIT_REPLY = re.compile(r"\d")


class _EdgeTime(NamedTuple):
    """When an edge comes: so long after the edge that it hangs on."""

    hangs_on: str
    after_ps: int


@dataclass(frozen=True)
class _EdgeTimes:
    """Times after one reference; ``only`` that one has a number (a width is fall minus rise)."""

    steps: Steps
    reference: str
    only: bool
    unit: str = "ps"

    def native(self, value: Quantity, where: str) -> _EdgeTime:
        """Return the nearest step after the reference."""
        return _EdgeTime(self.reference, self.steps.native(value, where))

    def shown(self, native: _EdgeTime) -> int | None:
        """Return picoseconds after the edge it hangs on; None for a width that is no number of its own."""
        return None if self.only and native.hangs_on != self.reference else native.after_ps


_TRIGGERS = {
    "off": "5",  # single shot: nothing fires unless *TRG comes
    "internal": "0",
    "external rising": "1",
    "external falling": "2",
    "single external rising": "3",
    "single external falling": "4",
    "line": "6",
}
_INHIBITS = {"off": "0", "triggers": "1", "AB": "2", "AB CD": "3", "AB CD EF": "4", "all": "5"}

# name: (mnemonic with its fixed index, domain, decimals on the wire)
_SYSTEM_NUMBERS: dict[str, tuple[str, Steps, int]] = {
    "trigger_rate": ("TRAT", Steps("rate", "uHz", 10**6, 1, 100, 10**13), 6),
    "trigger_level": ("TLVL", Steps("voltage", "mV", 1000, 10, -3500, 3500), 2),
    "holdoff": ("HOLD", _TIME, 12),
    "burst_count": ("BURC", Steps("number", "", 1, 1, 1, 2**32 - 1), 0),
    "burst_period": ("BURP", Steps("time", "ps", 10**12, 10_000, 100_000, 1_999_999_999_990_000), 8),
    "burst_delay": ("BURD", _TIME, 12),
}
_SYSTEM_NAMES: dict[str, tuple[str, Names]] = {
    "trigger_source": ("TSRC", Names(_TRIGGERS)),
    "inhibit": ("INHB", Names(_INHIBITS)),
    "burst_t0": ("BURT", Names({"all": "0", "first": "1"})),
}
_SYSTEM_SWITCHES = {"advanced_triggering": "ADVT", "burst": "BURM"}
_OUTPUT_NUMBERS: dict[str, tuple[str, Steps, int]] = {
    "amplitude": ("LAMP", Steps("voltage", "mV", 1000, 10, 500, 5000), 2),
    "offset": ("LOFF", Steps("voltage", "mV", 1000, 10, -2000, 2000), 2),
    "prescale": ("PRES", Steps("number", "", 1, 1, 1, 2**16 - 1), 0),
    "phase": ("PHAS", Steps("number", "", 1, 1, 0, 2**16 - 1), 0),
}

_ERRORS = {
    10: "illegal value", 11: "illegal mode", 12: "illegal delay", 13: "illegal link", 14: "recall failed",
    15: "not allowed: locked elsewhere", 16: "failed self test", 17: "failed auto calibration",
    30: "lost data", 32: "no listener", 110: "illegal command", 111: "undefined command",
    112: "illegal query", 113: "illegal set",
    114: "null parameter", 115: "extra parameters", 116: "missing parameters",
    117: "parameter overflow", 118: "invalid number", 120: "invalid integer", 121: "integer overflow",
    122: "invalid hexadecimal", 126: "syntax error", 170: "communication error", 171: "input overrun",
    254: "too many errors",
}  # fmt: skip


class DG645:
    """Lines and replies of the DG645."""

    model = MODELS["dg645"]
    terminator = "\n"
    stacked = True
    acknowledgement: re.Pattern[str] | None = None
    error_query: Line | None = Line("LERR?", re.compile(r"\d{1,3}"))
    system_properties: tuple[str, ...] = (*_SYSTEM_NAMES, *_SYSTEM_NUMBERS, *_SYSTEM_SWITCHES)
    output_properties: tuple[str, ...] = ("delay", "width", "link", "polarity", *_OUTPUT_NUMBERS)

    def identity(self, reply: str) -> Identity | None:
        """Read the reply to ``*IDN?``, or None if no DG645 gave it."""
        fields = re.fullmatch(r"([^,]*Stanford[^,]*),(DG645),(?:s/n)?(\w+),ver([\w.]+)", reply)
        return None if fields is None else Identity(fields[1], fields[2], fields[3], fields[4], reply)

    def output_named(self, name: str) -> str:
        """Return the output called ``name``; T0 is one too, with levels but no times of its own."""
        return "T0" if name.upper() == "T0" else output_named(self.model, name)

    def property(self, name: str, output: str | None) -> Property:
        """Return one property with its lines.

        Raises
        ------
        PlanError
            If the DG645 has no such property.
        """
        if output is None:
            return self._of_system(name)
        index = _OUTPUTS[output]
        if name == "polarity":
            polarities = Names({"positive": "1", "negative": "0"})
            return _named(name, output, polarities, "LPOL", f"{index}")
        if name in _OUTPUT_NUMBERS:
            mnemonic, steps, decimals = _OUTPUT_NUMBERS[name]
            return _numbered(name, output, steps, mnemonic, f"{index}", decimals)
        if output == "T0":
            raise unknown_property(name, ("polarity", *_OUTPUT_NUMBERS), self.model)
        rise, fall = 2 * index, 2 * index + 1
        if name == "delay":
            return _edge_time(name, output, rise, 0)
        if name == "width":
            return _edge_time(name, output, fall, rise)
        if name == "link":
            edges = Names({edge: str(number) for number, edge in enumerate(_EDGES) if edge != "T1"})
            return _named(name, output, edges, "LINK", f"{rise}")
        raise unknown_property(name, self.output_properties, self.model)

    def _of_system(self, name: str) -> Property:
        if name in _SYSTEM_NUMBERS:
            mnemonic, steps, decimals = _SYSTEM_NUMBERS[name]
            return _numbered(name, None, steps, mnemonic, "", decimals)
        if name in _SYSTEM_NAMES:
            mnemonic, names = _SYSTEM_NAMES[name]
            return _named(name, None, names, mnemonic, "")
        if name in _SYSTEM_SWITCHES:
            mnemonic = _SYSTEM_SWITCHES[name]
            return Property(
                name,
                None,
                Switch(),
                (Line(f"{mnemonic}?", re.compile("[01]")),),
                lambda on: (f"{mnemonic}{int(on)}",),
                lambda replies: replies[0] == "1",
            )
        raise unknown_property(name, self.system_properties, self.model)

    def meaning_of_error(self, code: str) -> str:
        """Return the manual's words for an error code (p. 62-67)."""
        return _ERRORS.get(int(code), "hardware: see the manual, p. 62-67")

    def opening_lines(self) -> tuple[str, ...]:
        """Return what a session that writes sends first: nothing."""
        return ()

    def gate_steps(self, output: str, delay_ps: int, width_ps: int) -> tuple[Step, ...]:
        """Return the order that cannot widen the gate: the fall hangs on the rise before the rise moves."""
        return (
            Step("width", output, Fraction(width_ps, 10**12)),
            Step("delay", output, Fraction(delay_ps, 10**12)),
        )

    def safe_steps(self, output: str) -> tuple[Step, ...]:
        """Return what makes the box safe: no trigger fires, the gate as narrow as it goes."""
        return (
            Step("trigger_source", None, "off"),
            Step("width", output, Fraction(self.model.shortest_width_ps, 10**12)),
        )

    def conflicts(self, settings: Mapping[str, Any], output: str, first_ps: int, last_ps: int) -> list[Fault]:
        """Return what moving the gate between two delays would break on other outputs."""
        faults = []
        for other in self.model.outputs:
            held = settings.get(other, {})
            if other == output or held.get("link") not in tuple(output):
                continue
            for edge_ps in (first_ps, last_ps):
                moved = edge_ps + held["delay_ps"]
                if not _TIME.lowest <= moved + (held.get("width_ps") or 0) <= _TIME.highest or moved < 0:
                    advice = f"Link {other} to T0 first."
                    came = f"{moved} ps, because it hangs on {held['link']}"
                    faults.append(Fault(f"{other}.delay", came, "a time the box can hold", advice))
        return faults

    def save_line(self, slot: int) -> str:
        """Return the line that stores all settings."""
        return f"*SAV{slot}"

    def recall_lines(self, slot: int) -> tuple[str, ...]:
        """Return the lines that recall settings and stop the triggers at once."""
        return (f"*RCL{slot}", "TSRC5")


def _numbered(
    name: str, output: str | None, steps: Steps, mnemonic: str, index: str, decimals: int
) -> Property:
    comma = "," if index else ""
    return Property(
        name,
        output,
        steps,
        (Line(f"{mnemonic}?{index}", _NUMBER_REPLY),),
        lambda native: (f"{mnemonic}{index}{comma}{steps.text(native, decimals)}",),
        lambda replies: steps.parse(replies[0]),
    )


def _named(name: str, output: str | None, names: Names, mnemonic: str, index: str) -> Property:
    comma = "," if index else ""
    return Property(
        name,
        output,
        names,
        (Line(f"{mnemonic}?{index}", _DIGIT_REPLY),),
        lambda native: (f"{mnemonic}{index}{comma}{names.wire[native]}",),
        lambda replies: names.parse(replies[0]),
    )


def _edge_time(name: str, output: str, edge: int, reference: int) -> Property:
    """Return the time of an edge after its reference: T0 for the rise, the rise for the fall."""
    is_width = name == "width"
    times = _EdgeTimes(_WIDTH if is_width else _TIME, _EDGES[reference], only=is_width)

    def parse(replies: Sequence[str]) -> _EdgeTime:
        matched = _DELAY_REPLY.fullmatch(replies[0])
        if matched is None:
            raise ReplyError(f"reply {replies[0]!r}: wanted edge,+seconds")
        return _EdgeTime(_EDGES[int(matched[1])], _TIME.parse(matched[2]))

    return Property(
        name,
        output,
        times,
        (Line(f"DLAY?{edge}", _DELAY_REPLY),),
        lambda native: (f"DLAY{edge},{_EDGES.index(native.hangs_on)},{_TIME.text(native.after_ps, 12)}",),
        parse,
    )
