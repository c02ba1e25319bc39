"""A simulated Quantum Composers 9520/9530 or BNC 575: the device alone, without line, clock or thread.

``feed`` takes one command and returns its reply: a value, ``ok`` or ``?n``. Keywords are their short form
(capitals) or the whole word. Written from the 9500+ manual (p. 42-44) and the command trees of drivers in
use; what a missing channel answers is not known and taken as ``?3``.
"""

from __future__ import annotations

import copy
import re
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation

from rig.simulator.edges import Edge, PulseOutput

_PS = Decimal(10) ** 12
_LONGEST_PS = 999_999_999_999_750
_CHANNELS = ("A", "B", "C", "D")
_MEMORY_SLOTS = range(1, 13)


class _Refusal(Exception):  # noqa: N818 - not an error of the program
    """The device answers ``?n``."""

    def __init__(self, code: int) -> None:
        self.code = code


@dataclass(frozen=True)
class _Number:
    scale: Decimal
    step: int
    lowest: int
    highest: int
    decimals: int

    def read(self, text: str) -> int:
        try:
            value = Decimal(text)
        except InvalidOperation:
            raise _Refusal(5) from None
        if not value.is_finite() or not self.lowest <= value * self.scale <= self.highest:
            raise _Refusal(5)
        return int((value * self.scale / self.step).to_integral_value()) * self.step

    def write(self, value: int | str) -> str:
        return f"{Decimal(value) / self.scale:.{self.decimals}f}"


@dataclass(frozen=True)
class _Flag:
    def read(self, text: str) -> int:
        if text.upper() not in ("0", "1", "ON", "OFF"):
            raise _Refusal(5)
        return int(text.upper() in ("1", "ON"))

    def write(self, value: int | str) -> str:
        return str(value)


@dataclass(frozen=True)
class _Word:
    words: tuple[str, ...]  # the capitals of each are its short form

    def read(self, text: str) -> str:
        for word in self.words:
            if _is_keyword(text, word):
                return _short(word)
        raise _Refusal(5)

    def write(self, value: int | str) -> str:
        return str(value)


_WIDTH = _Number(_PS, 250, 10_000, _LONGEST_PS, 11)
_DELAY = _Number(_PS, 250, -_LONGEST_PS, _LONGEST_PS, 11)
_COUNT = _Number(Decimal(1), 1, 1, 9_999_999, 0)
_VOLTS = Decimal(1000)
_SYSTEM: dict[str, tuple[_Number | _Flag | _Word, int | str]] = {
    "STATe": (_Flag(), 0),
    "PERiod": (_Number(_PS, 10_000, 100_000, 5_000 * 10**12, 11), 10**9),
    "MODe": (_Word(("NORMal", "SINGle", "BURSt", "DCYCle")), "NORM"),
    "BCOunter": (_COUNT, 1),
    "PCOunter": (_COUNT, 1),
    "OCOunter": (_COUNT, 1),
    "TRIGger:MODe": (_Word(("DISabled", "TRIGgered", "DUAL")), "DIS"),
    "TRIGger:EDGe": (_Word(("RISing", "FALLing")), "RIS"),
    "TRIGger:LEVel": (_Number(_VOLTS, 10, 200, 15_000, 2), 2_500),
    "GATe:MODe": (_Word(("DISabled", "PULSe", "OUTPut", "CHANnel")), "DIS"),
    "GATe:LOGic": (_Word(("LOW", "HIGH")), "HIGH"),
    "GATe:LEVel": (_Number(_VOLTS, 10, 200, 15_000, 2), 2_500),
    "ICLock:MODe": (_Word(("INTernal", "EXTernal", "XPLl")), "INT"),
}
_CHANNEL: dict[str, tuple[_Number | _Flag | _Word, int | str]] = {
    "STATe": (_Flag(), 0),
    "WIDTh": (_WIDTH, 100_000),
    "DELay": (_DELAY, 0),
    "SYNC": (_Word(("T0", *(f"CH{channel}" for channel in _CHANNELS))), "T0"),
    "MUX": (_Number(Decimal(1), 1, 0, 15, 0), 0),
    "POLarity": (_Word(("NORMal", "COMPlement", "INVerted")), "NORM"),
    "OUTPut:MODe": (_Word(("TTL", "ADJustable")), "TTL"),
    "OUTPut:AMPLitude": (_Number(_VOLTS, 10, 2_000, 20_000, 2), 4_000),
    "CMODe": (_Word(("NORMal", "SINGle", "BURSt", "DCYCle")), "NORM"),
    "BCOunter": (_COUNT, 1),
    "PCOunter": (_COUNT, 1),
    "OCOunter": (_COUNT, 1),
    "WCOunter": (_Number(Decimal(1), 1, 0, 9_999_999, 0), 0),
    "CGATe": (_Word(("DISabled", "PULSe", "OUTPut")), "DIS"),
    "CLOGic": (_Word(("LOW", "HIGH")), "HIGH"),
}


def _short(word: str) -> str:
    return "".join(letter for letter in word if not letter.islower())


def _is_keyword(text: str, word: str) -> bool:
    return text.upper() in (_short(word), word.upper())


def _defaults() -> list[dict[str, int | str]]:
    system = {name: default for name, (_, default) in _SYSTEM.items()}
    return [system, *({name: default for name, (_, default) in _CHANNEL.items()} for _ in _CHANNELS)]


@dataclass
class SimulatedBNC575:
    """The device.

    Parameters
    ----------
    serial : str
        Five digits.
    """

    serial: str = "02311"
    clock_ps: int = 0
    edges: list[Edge] = field(default_factory=list)
    settings: list[dict[str, int | str]] = field(default_factory=_defaults)
    locked: bool = False
    echo: bool = False
    _memory: dict[int, list[dict[str, int | str]]] = field(default_factory=dict)
    _selected: int = 1
    _busy_until_ps: int = -1

    model = "bnc575"
    terminator = "\r\n"
    separators = "\n"
    input_limit = 255

    def feed(self, line: str) -> str | None:
        """Run one command; return its reply without a terminator, or None for an empty line."""
        if not line.strip():
            return None
        try:
            reply = self._run(line.strip())
        except _Refusal as refusal:
            reply = f"?{refusal.code}"
        return f"{line.strip()}\r\n{reply}" if self.echo else reply

    def complain(self, code: int) -> None:
        """Do nothing: this family answers every command and keeps no queue."""

    def power_cycle(self) -> None:
        """Come back with the settings of power-up."""
        self.settings = copy.deepcopy(self._memory.get(1, _defaults()))

    def resolution(self, line: str) -> Decimal:
        """Return the step, in the wire's unit, of the last number in a set."""
        keyword = line.split(":", 2)[-1].split(maxsplit=1)[0]
        for name, (kind, _) in (*_SYSTEM.items(), *_CHANNEL.items()):
            if isinstance(kind, _Number) and _matches(keyword.split(":"), name):
                return kind.step / kind.scale
        return Decimal(1)

    def trigger(self, source: str = "external rising") -> bool:
        """Give a trigger at the virtual clock's time; return whether a cycle began."""
        system = self.settings[0]
        external = system["TRIGger:MODe"] != "DIS"
        edge = {"external rising": "RIS", "external falling": "FALL"}.get(source)
        fits = system["TRIGger:EDGe"] == edge if external else source == "internal"
        if not system["STATe"] or not fits or self.clock_ps < self._busy_until_ps:
            return False
        for number, name in enumerate(_CHANNELS, 1):
            channel = self.settings[number]
            if channel["STATe"]:
                rise = self._absolute_ps(number)
                inverted = channel["POLarity"] != "NORM"
                pulse = PulseOutput(name, rise, rise + int(channel["WIDTh"]), inverted)
                self.edges += pulse.edges(self.clock_ps)
        ends = [self._absolute_ps(number) + int(self.settings[number]["WIDTh"]) for number in range(1, 5)]
        self._busy_until_ps = self.clock_ps + max(ends) + 100_000
        return True

    def advance(self, picoseconds: int) -> None:
        """Let the virtual clock run."""
        self.clock_ps += picoseconds

    def _absolute_ps(self, number: int) -> int:
        channel = self.settings[number]
        link = str(channel["SYNC"])
        after = int(channel["DELay"])
        return after if link == "T0" else after + self._absolute_ps(_CHANNELS.index(link[2]) + 1)

    def _run(self, line: str) -> str:
        head, _, argument = line.partition(" ")
        query = head.endswith("?")
        head, argument = head.rstrip("?"), argument.strip()
        if head.startswith("*"):
            return self._common(head[1:].upper(), query, argument)
        if not head.startswith(":"):
            raise _Refusal(1)
        words = head[1:].split(":")
        if words == [""]:
            raise _Refusal(2)
        channel = re.fullmatch(r"(?:PULSE?|S?PULSE)(\d?)", words[0].upper())
        if channel is not None:
            if len(words) < 2:
                raise _Refusal(2)
            return self._setting(self._number_of(words[0].upper(), channel[1]), words[1:], query, argument)
        return self._rest(words, query, argument)

    def _number_of(self, word: str, digits: str) -> int:
        number = 0 if word.startswith("SP") else int(digits) if digits else self._selected
        if number > len(_CHANNELS):
            raise _Refusal(3)
        self._selected = number or self._selected
        return number

    def _setting(self, number: int, words: list[str], query: bool, argument: str) -> str:
        table = _CHANNEL if number else _SYSTEM
        name = next((name for name in table if _matches(words, name)), None)
        if name is None:
            raise _Refusal(3)
        kind = table[name][0]
        if query:
            return kind.write(self.settings[number][name])
        if not argument:
            raise _Refusal(4)
        value = kind.read(argument)
        if self.locked:
            raise _Refusal(8)
        if name == "SYNC" and self._would_circle(number, str(value)):
            raise _Refusal(5)
        self.settings[number][name] = value
        return "ok"

    def _would_circle(self, number: int, link: str) -> bool:
        own = f"CH{_CHANNELS[number - 1]}"
        while link != "T0":
            if link == own:
                return True
            link = str(self.settings[_CHANNELS.index(link[2]) + 1]["SYNC"])
        return False

    def _common(self, name: str, query: bool, argument: str) -> str:
        if name == "IDN":
            if not query:
                raise _Refusal(6)
            return f"QC,9534,{self.serial},1.2.2-1.2.0"
        if query:
            raise _Refusal(7)
        if name == "RST":
            self.settings, self._selected = _defaults(), 1
        elif name == "TRG":
            self.trigger("internal")
        elif name in ("SAV", "RCL"):
            if not argument.isdigit() or int(argument) not in _MEMORY_SLOTS:
                raise _Refusal(5 if argument else 4)
            if name == "SAV":
                self._memory[int(argument)] = copy.deepcopy(self.settings)
            elif int(argument) not in self._memory:
                raise _Refusal(8)
            else:
                self.settings = copy.deepcopy(self._memory[int(argument)])
        else:
            raise _Refusal(3)
        return "ok"

    def _rest(self, words: list[str], query: bool, argument: str) -> str:
        if _matches(words, "INSTrument:CATalog"):
            return "T0, " + ", ".join(f"CH{channel}" for channel in _CHANNELS)
        if _matches(words, "SYSTem:COMMunicate:SERial:ECHO"):
            if query:
                return str(int(self.echo))
            self.echo = bool(_Flag().read(argument))
            return "ok"
        if _matches(words, "INSTrument:SELect"):
            names = ("T0", *(f"CH{channel}" for channel in _CHANNELS))
            if query:
                return names[self._selected]
            if argument.upper() not in names:
                raise _Refusal(5 if argument else 4)
            self._selected = names.index(argument.upper())
            return "ok"
        if _matches(words, "INSTrument:STATe"):
            return self._setting(0, ["STAT"], query, argument)
        if _matches(words, "SYSTem:VERSion"):
            return "1999.0"
        raise _Refusal(3)


def _matches(words: list[str], name: str) -> bool:
    wanted = name.split(":")
    return len(words) == len(wanted) and all(map(_is_keyword, words, wanted))
