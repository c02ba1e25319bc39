"""The language of the Quantum Composers 9520/9530 and BNC 575 family (9500+ manual, p. 42-44).

Every command is answered: a value, ``ok``, or ``?n``. Commands are never stacked. Delays and widths
have steps of 250 ps and go out with eleven decimals, the fewest that hold them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from rig.dialect import Identity, Line, Names, Property, Step, Steps, Switch, unknown_property
from rig.errors import Fault, PlanError, ReplyError
from rig.models import MODELS, output_named
from rig.quantity import Quantity, decimal_text, exact, nearest

_LONGEST_PS = 999_999_999_999_750
_DELAY = Steps("time", "ps", 10**12, 250, -_LONGEST_PS, _LONGEST_PS)
_WIDTH = Steps("time", "ps", 10**12, 250, 10_000, _LONGEST_PS)
_PERIOD = Steps("time", "ps", 10**12, 10_000, 100_000, 5_000 * 10**12)
_LEVEL = Steps("voltage", "mV", 1000, 10, 200, 15_000)
_AMPLITUDE = Steps("voltage", "mV", 1000, 10, 2_000, 20_000)
_COUNT = Steps("number", "", 1, 1, 1, 9_999_999)
_TIME_REPLY = re.compile(r"[+-]?\d+\.\d{9,12}")
_NUMBER_REPLY = re.compile(r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
_FLAG_REPLY = re.compile(r"[01]")
_WORD_REPLY = re.compile(r"[A-Z0-9]+")

_TRIGGERS = ("off", "internal", "external rising", "external falling")
_INHIBITS = {"off": "DIS", "triggers": "PULS", "all": "OUTP"}
_ERRORS = {
    "?1": "incorrect prefix",
    "?2": "missing keyword",
    "?3": "invalid keyword",
    "?4": "missing parameter",
    "?5": "invalid parameter",
    "?6": "query only",
    "?7": "no query form",
    "?8": "not available in this state",
}


@dataclass(frozen=True)
class _RateAsPeriod:
    """A rate that the box holds as a period in steps of 10 ns; the native form is the period (ps)."""

    unit: str = "Hz"
    periods: Steps = _PERIOD

    def native(self, value: Quantity, where: str) -> int:
        """Return the period nearest to one over the rate."""
        rate = exact(value, "rate", name=where)
        if rate <= 0 or not self.periods.lowest <= 10**12 / rate <= self.periods.highest:
            raise PlanError(where, [Fault(where, repr(value), "0.0002 Hz to 10 MHz")])
        return nearest(10**12 / rate, self.periods.step) * self.periods.step

    def shown(self, native: int) -> float:
        """Return hertz."""
        return float(Fraction(10**12, native))


@dataclass(frozen=True)
class _TriggerSources:
    """Trigger sources: three settings of the box under one name."""

    unit: str = ""

    def native(self, value: Any, where: str) -> str:
        """Return the name itself, or refuse it."""
        name = str(value).strip().lower()
        if name not in _TRIGGERS:
            raise PlanError(where, [Fault(where, repr(value), f"one of {', '.join(_TRIGGERS)}")])
        return name

    def shown(self, native: str) -> str:
        """Return the name."""
        return native


class BNC575:
    """Lines and replies of the family."""

    model = MODELS["bnc575"]
    terminator = "\r\n"
    stacked = False
    acknowledgement: re.Pattern[str] | None = re.compile(r"ok|\?[1-8]")
    error_query: Line | None = None
    system_properties: tuple[str, ...] = (
        "trigger_source",
        "trigger_rate",
        "trigger_period",
        "trigger_level",
        "inhibit",
        "burst",
        "burst_count",
    )
    output_properties: tuple[str, ...] = ("delay", "width", "link", "polarity", "amplitude", "enabled")

    def __init__(self) -> None:
        self._decimals: int | None = None

    def identity(self, reply: str) -> Identity | None:
        """Read the reply to ``*IDN?``, or None if no box of this family gave it."""
        fields = re.fullmatch(r"(QC|BNC),([\w+-]+),(\w+),([\w.-]+)", reply)
        return None if fields is None else Identity(fields[1], fields[2], fields[3], fields[4], reply)

    def output_named(self, name: str) -> str:
        """Return the output called ``name``, with or without its ``CH``."""
        return output_named(self.model, name)

    def property(self, name: str, output: str | None) -> Property:
        """Return one property with its lines.

        Raises
        ------
        PlanError
            If the family has no such property.
        """
        if output is None:
            return self._of_system(name)
        channel = f":PULSE{self.model.outputs.index(output) + 1}"
        if name in ("delay", "width"):
            steps, keyword = (_DELAY, "DEL") if name == "delay" else (_WIDTH, "WIDT")
            return self._timed(name, output, steps, f"{channel}:{keyword}")
        if name == "link":
            links = {"T0": "T0", **{other: f"CH{other}" for other in self.model.outputs if other != output}}
            return _named(name, output, Names(links), f"{channel}:SYNC")
        if name == "polarity":
            wire = {"positive": "NORM", "negative": "INV", "complement": "COMP"}
            return _named(name, output, Names(wire), f"{channel}:POL")
        if name == "enabled":
            return _switched(name, output, f"{channel}:STATE")
        if name == "amplitude":
            return _amplitude(output, channel)
        raise unknown_property(name, self.output_properties, self.model)

    def _of_system(self, name: str) -> Property:
        if name == "trigger_source":
            return _trigger_source()
        if name == "trigger_rate":
            return self._timed(name, None, _PERIOD, ":PULSE0:PER", _RateAsPeriod())
        if name == "trigger_period":
            return self._timed(name, None, _PERIOD, ":PULSE0:PER")
        if name == "trigger_level":
            return _numbered(name, None, _LEVEL, ":PULSE0:TRIG:LEV", 2)
        if name == "burst_count":
            return _numbered(name, None, _COUNT, ":PULSE0:BCO", 0)
        if name == "inhibit":
            return _named(name, None, Names(_INHIBITS), ":PULSE0:GAT:MOD")
        if name == "burst":
            line = Line(":PULSE0:MOD?", _WORD_REPLY)
            return Property(
                name,
                None,
                Switch(),
                (line,),
                lambda on: (f":PULSE0:MOD {'BURS' if on else 'NORM'}",),
                lambda replies: replies[0] == "BURS",
            )
        raise unknown_property(name, self.system_properties, self.model)

    def _timed(
        self, name: str, output: str | None, steps: Steps, keyword: str, domain: Any = None
    ) -> Property:
        def parse(replies: Sequence[str]) -> int:
            decimals = len(replies[0].partition(".")[2])
            self._decimals = self._decimals or decimals
            if decimals != self._decimals:
                raise ReplyError(f"reply {replies[0]!r}: {decimals} decimals; wanted {self._decimals}")
            return steps.parse(replies[0])

        return Property(
            name,
            output,
            domain or steps,
            (Line(f"{keyword}?", _TIME_REPLY),),
            lambda native: (f"{keyword} {decimal_text(Fraction(native, 10**12), 11)}",),
            parse,
        )

    def meaning_of_error(self, code: str) -> str:
        """Return the manual's words for an error (p. 44)."""
        return _ERRORS.get(code, "unknown error")

    def opening_lines(self) -> tuple[str, ...]:
        """Return what a session that writes sends first: no echo, which would double every reply."""
        return (":SYST:COMM:SER:ECHO OFF",)

    def gate_steps(self, output: str, delay_ps: int, width_ps: int) -> tuple[Step, ...]:
        """Return the order of a new gate; the delay counts from T0."""
        return (
            Step("link", output, "T0"),
            Step("width", output, Fraction(width_ps, 10**12)),
            Step("delay", output, Fraction(delay_ps, 10**12)),
        )

    def safe_steps(self, output: str) -> tuple[Step, ...]:
        """Return what makes the box safe: stopped, the gate's output off, its pulse as narrow as it goes."""
        return (
            Step("trigger_source", None, "off"),
            Step("enabled", output, False),
            Step("width", output, Fraction(self.model.shortest_width_ps, 10**12)),
        )

    def conflicts(self, settings: Mapping[str, Any], output: str, first_ps: int, last_ps: int) -> list[Fault]:
        """Return what moving the gate would break: outputs that count their delay from it."""
        return [
            Fault(
                f"{other}.link", f"{output}", "T0", f"{other} would move with the gate: link it to T0 first."
            )
            for other in self.model.outputs
            if other != output and settings.get(other, {}).get("link") == output
        ]

    def save_line(self, slot: int) -> str:
        """Return the line that stores all settings."""
        return f"*SAV {slot}"

    def recall_lines(self, slot: int) -> tuple[str, ...]:
        """Return the lines that recall settings and stop the box at once."""
        return (f"*RCL {slot}", ":PULSE0:STATE 0")


def _numbered(name: str, output: str | None, steps: Steps, keyword: str, decimals: int) -> Property:
    return Property(
        name,
        output,
        steps,
        (Line(f"{keyword}?", _NUMBER_REPLY),),
        lambda native: (f"{keyword} {steps.text(native, decimals)}",),
        lambda replies: steps.parse(replies[0]),
    )


def _named(name: str, output: str | None, names: Names, keyword: str) -> Property:
    return Property(
        name,
        output,
        names,
        (Line(f"{keyword}?", _WORD_REPLY),),
        lambda native: (f"{keyword} {names.wire[native]}",),
        lambda replies: names.parse(replies[0]),
    )


def _switched(name: str, output: str | None, keyword: str) -> Property:
    return Property(
        name,
        output,
        Switch(),
        (Line(f"{keyword}?", _FLAG_REPLY),),
        lambda on: (f"{keyword} {int(on)}",),
        lambda replies: replies[0] == "1",
    )


def _amplitude(output: str, channel: str) -> Property:
    """An amplitude acts only when the output is adjustable, so both are set and both are asked."""

    def parse(replies: Sequence[str]) -> int:
        return _AMPLITUDE.parse(replies[1]) if replies[0] == "ADJ" else 0  # TTL has a level of its own

    def set_lines(native: int) -> tuple[str, ...]:
        if native == 0:
            return (f"{channel}:OUTP:MOD TTL",)
        return (f"{channel}:OUTP:MOD ADJ", f"{channel}:OUTP:AMPL {_AMPLITUDE.text(native, 2)}")

    asked = (Line(f"{channel}:OUTP:MOD?", _WORD_REPLY), Line(f"{channel}:OUTP:AMPL?", _NUMBER_REPLY))
    return Property("amplitude", output, _AMPLITUDE, asked, set_lines, parse)


def _trigger_source() -> Property:
    wire = {
        "internal": ("DIS", "RIS"),
        "external rising": ("TRIG", "RIS"),
        "external falling": ("TRIG", "FALL"),
    }

    def set_lines(name: str) -> tuple[str, ...]:
        if name == "off":
            return (":PULSE0:STATE 0",)
        mode, edge = wire[name]
        return (
            ":PULSE0:STATE 0",
            f":PULSE0:TRIG:MOD {mode}",
            f":PULSE0:TRIG:EDG {edge}",
            ":PULSE0:STATE 1",
        )

    def parse(replies: Sequence[str]) -> str:
        running, mode, edge = replies
        if running == "0":
            return "off"
        if mode == "DIS":
            return "internal"
        return "external rising" if edge == "RIS" else "external falling"

    asked = (
        Line(":PULSE0:STATE?", _FLAG_REPLY),
        Line(":PULSE0:TRIG:MOD?", _WORD_REPLY),
        Line(":PULSE0:TRIG:EDG?", _WORD_REPLY),
    )
    return Property("trigger_source", None, _TriggerSources(), asked, set_lines, parse)
