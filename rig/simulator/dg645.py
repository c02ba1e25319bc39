"""A simulated DG645: the device alone, without any line, clock or thread of its own.

``feed`` takes one command and returns its reply, or None. Written from the manual (rev. 1.1, p. 27-67).
What the manual leaves open is decided here and can be chosen: the order of ``LERR?`` (first in, first
out), remote values rounded to the grid like the panel's, a refused command changing nothing.
"""

from __future__ import annotations

import copy
import re
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation

from rig.simulator.edges import Edge, PulseOutput

STEP_PS = 5
_LONGEST_PS = 1_999_999_999_999_995
_EDGES = ("T0", "T1", "A", "B", "C", "D", "E", "F", "G", "H")
_PS = Decimal(10) ** 12
_COMMAND = re.compile(r"(\*[A-Za-z]{3}|[A-Za-z]{4})(\??)\s*(.*)")
_EXECUTION, _PARSING = 1 << 4, 1 << 5
_POWER_ON = 1 << 7


class _Refusal(Exception):  # noqa: N818 - not an error of the program
    """The device refuses a command with a code of its error queue."""

    def __init__(self, code: int) -> None:
        self.code = code


@dataclass
class _Settings:
    """What *SAV stores and *RST resets."""

    delays: list[tuple[int, int]] = field(
        default_factory=lambda: [
            (0, 0),
            (0, 0),
            *((0, 0) if edge % 2 == 0 else (edge - 1, 10_000) for edge in range(2, 10)),
        ]
    )  # (reference edge, ps after it)
    amplitude: list[int] = field(default_factory=lambda: [2500] * 5)  # mV
    offset: list[int] = field(default_factory=lambda: [0] * 5)
    polarity: list[int] = field(default_factory=lambda: [1] * 5)
    prescale: list[int] = field(default_factory=lambda: [1] * 5)
    phase: list[int] = field(default_factory=lambda: [0] * 5)
    numbers: dict[str, int] = field(
        default_factory=lambda: {
            "TSRC": 5, "TRAT": 1_000_000_000, "TLVL": 1000, "ADVT": 0, "HOLD": 0, "INHB": 1, "BURM": 0,
            "BURC": 5, "BURP": 100_000_000, "BURD": 0, "BURT": 0,
        }
    )  # fmt: skip
    steps: dict[str, int] = field(default_factory=dict)
    display: tuple[int, int] = (11, 2)


@dataclass(frozen=True)
class _Number:
    """One numeric setting: the unit's scale, its step and ends, and the decimals of its reply."""

    scale: Decimal
    step: int
    lowest: int
    highest: int
    decimals: int


_TIME = _Number(_PS, STEP_PS, 0, _LONGEST_PS, 12)
_CHOICE = {"TSRC": 6, "ADVT": 1, "INHB": 5, "BURM": 1, "BURT": 1}
_NUMBERS = {
    "TRAT": _Number(Decimal(10) ** 6, 1, 100, 10**13, 6),
    "TLVL": _Number(Decimal(1000), 10, -3500, 3500, 2),
    "HOLD": _TIME,
    "BURC": _Number(Decimal(1), 1, 1, 2**32 - 1, 0),
    "BURP": _Number(_PS, 10_000, 100_000, 1_999_999_999_990_000, 12),
    "BURD": _TIME,
    **{name: _Number(Decimal(1), 1, 0, most, 0) for name, most in _CHOICE.items()},
}
_LEVELS = {
    "LAMP": ("amplitude", _Number(Decimal(1000), 10, 500, 5000, 2)),
    "LOFF": ("offset", _Number(Decimal(1000), 10, -2000, 2000, 2)),
    "LPOL": ("polarity", _Number(Decimal(1), 1, 0, 1, 0)),
}
_STEP_NAMES = ("HD", "PH", "PS", "TL", "TR", "BC", "BD", "BP", "DL", "LA", "LO")
_INTERFACE = {0: 1, 1: 9600, 2: 1, 3: 15, 4: 1, 5: 1, 6: 1, 7: 1, 8: 1, 9: 1, 10: 1}
_LOWEST_PARSE_ERROR = 110


class SimulatedDG645:
    """The device.

    Parameters
    ----------
    serial : str
        Six digits.
    """

    model = "dg645"
    terminator = "\r\n"
    separators = ";\r\n"
    input_limit = 255

    def __init__(self, serial: str = "004025") -> None:
        self.serial = serial
        self.clock_ps = 0
        self.edges: list[Edge] = []
        self.errors: deque[int] = deque()
        self.locked = False
        self._busy_until_ps = -1
        self._armed_once = False
        self._memory: dict[int, _Settings] = {}
        self._status = {"ESR": _POWER_ON, "INSR": 0, "ESE": 0, "SRE": 0, "INSE": 0, "PSC": 1}
        self._interface = dict(_INTERFACE)
        self.settings = _Settings()
        self._commands = self._command_table()

    def feed(self, line: str) -> str | None:
        """Run one command; return its reply without a terminator, or None."""
        if not line.strip():
            return None
        try:
            return self._run(line.strip())
        except _Refusal as refusal:
            self.complain(refusal.code)
            return None

    def complain(self, code: int) -> None:
        """Put an error on the queue of twenty; what comes after the nineteenth is 'too many errors'."""
        if len(self.errors) < 19:
            self.errors.append(code)
        elif len(self.errors) == 19:
            self.errors.append(254)
        self._status["ESR"] |= _PARSING if code >= _LOWEST_PARSE_ERROR else _EXECUTION

    def power_cycle(self) -> None:
        """Lose everything that was not saved: the settings of power-up, and the power-on bit."""
        self.settings = copy.deepcopy(self._memory.get(0, _Settings()))
        self.errors.clear()
        self._status.update(ESR=_POWER_ON, INSR=0)

    def absolute_ps(self, edge: int) -> int:
        """Return when an edge comes after T0, along its links."""
        reference, after = self.settings.delays[edge]
        return after if reference == 0 or edge == 0 else after + self.absolute_ps(reference)

    def resolution(self, line: str) -> Decimal:
        """Return the step, in the wire's unit, of the last number in a set."""
        name = line[:4].upper()
        number = _NUMBERS.get(name) or (_LEVELS[name][1] if name in _LEVELS else _TIME)
        return number.step / number.scale

    @property
    def longest_ps(self) -> int:
        """The last edge of a cycle."""
        return max(self.absolute_ps(edge) for edge in range(2, 10))

    def trigger(self, source: str = "external rising") -> bool:
        """Give a trigger at the virtual clock's time; return whether a cycle began."""
        wanted = {
            "internal": (0,), "external rising": (1, 3), "external falling": (2, 4), "single": (5,),
            "line": (6,),
        }[source]  # fmt: skip
        mode = self.settings.numbers["TSRC"]
        if mode not in wanted or (mode in (3, 4, 5) and not self._armed_once):
            return False
        if self.clock_ps < self._busy_until_ps:
            self._status["INSR"] |= 1 << 1  # RATE: the trigger came during a cycle
            return False
        self._armed_once = False
        self._status["INSR"] |= 1
        for name, rise in (("AB", 2), ("CD", 4), ("EF", 6), ("GH", 8)):
            inverted = self.settings.polarity[rise // 2] == 0
            pulse = PulseOutput(name, self.absolute_ps(rise), self.absolute_ps(rise + 1), inverted)
            self.edges += pulse.edges(self.clock_ps)
        self._busy_until_ps = self.clock_ps + 100_000 + self.longest_ps
        return True

    def advance(self, picoseconds: int) -> None:
        """Let the virtual clock run."""
        self.clock_ps += picoseconds
        if 0 <= self._busy_until_ps <= self.clock_ps:
            self._status["INSR"] |= 1 << 2  # END_OF_DELAY
            self._busy_until_ps = -1

    def _run(self, line: str) -> str | None:
        matched = _COMMAND.fullmatch(line)
        if matched is None:
            raise _Refusal(110)
        name, query, rest = matched[1].upper(), bool(matched[2]), matched[3]
        arguments = [part.strip() for part in rest.split(",")] if rest else []
        if any(len(part) > 25 for part in arguments):
            raise _Refusal(117)
        if "" in arguments:
            raise _Refusal(114)
        handler = self._commands.get(name)
        if handler is None:
            raise _Refusal(111)
        return handler(name, query, arguments)

    def _command_table(self) -> dict[str, Callable[[str, bool, list[str]], str | None]]:
        table: dict[str, Callable[[str, bool, list[str]], str | None]] = {
            "DLAY": self._delay, "LINK": self._link, "LERR": self._last_error, "PRES": self._divider,
            "PHAS": self._divider, "DISP": self._display, "IFCF": self._configuration, "*SAV": self._save,
            "*RCL": self._recall,
        }  # fmt: skip
        table |= dict.fromkeys(_NUMBERS, self._number)
        table |= dict.fromkeys(_LEVELS, self._level)
        table |= dict.fromkeys(("*ESE", "*SRE", "*PSC", "INSE"), self._register)
        table |= {f"SS{name}": self._step_size for name in _STEP_NAMES}
        table |= {f"SP{name}": self._step for name in _STEP_NAMES}
        table |= {
            "*IDN": self._asked(lambda: f"Stanford Research Systems,DG645,s/n{self.serial},ver1.14.10E"),
            "*STB": self._asked(self._status_byte),
            "*ESR": self._asked(lambda: self._taken("ESR")),
            "INSR": self._asked(lambda: self._taken("INSR")),
            "*TST": self._asked(lambda: "0"),
            "*CAL": self._asked(lambda: "0"),
            "TIMB": self._asked(lambda: "0"),
            "EMAC": self._asked(lambda: "00:19:B3:00:00:00"),
            "LOCK": self._asked(lambda: "1"),
            "UNLK": self._asked(lambda: "1"),
            "*RST": self._told(lambda: self._replace(_Settings())),
            "*CLS": self._told(self._clear_status),
            "*TRG": self._told(self._single_shot),
            **{
                name: self._told(lambda: None)
                for name in ("*WAI", "REMT", "LCAL", "IFRS", "SHDP", "XTRM", "EPHY")
            },
            "*OPC": lambda name, query, arguments: "1" if query else None,
        }
        return table

    @staticmethod
    def _asked(answer: Callable[[], str]) -> Callable[[str, bool, list[str]], str]:
        def handler(name: str, query: bool, arguments: list[str]) -> str:
            if not query:
                raise _Refusal(113)
            return answer()

        return handler

    def _told(self, act: Callable[[], None]) -> Callable[[str, bool, list[str]], None]:
        def handler(name: str, query: bool, arguments: list[str]) -> None:
            if query:
                raise _Refusal(112)
            act()

        return handler

    def _set(self) -> None:
        """Refuse a set while another interface holds the lock; note a cycle cut short."""
        if self.locked:
            raise _Refusal(15)
        if self.clock_ps < self._busy_until_ps:
            self._status["INSR"] |= 1 << 5  # ABORT_DELAY
            self._busy_until_ps = -1

    def _number(self, name: str, query: bool, arguments: list[str]) -> str | None:
        number = _NUMBERS[name]
        if query:
            _count(arguments, 0)
            return _write(number, self.settings.numbers[name])
        _count(arguments, 1)
        value = _read(number, arguments[0], 10)
        self._set()
        self.settings.numbers[name] = value
        return None

    def _level(self, name: str, query: bool, arguments: list[str]) -> str | None:
        place, number = _LEVELS[name]
        values: list[int] = getattr(self.settings, place)
        _count(arguments, 1 if query else 2)
        output = _index(arguments[0], 4)
        if query:
            return _write(number, values[output])
        value = _read(number, arguments[1], 10)
        levels = {
            "amplitude": self.settings.amplitude[output],
            "offset": self.settings.offset[output],
            place: value,
        }
        if levels["amplitude"] + levels["offset"] >= 6000:
            raise _Refusal(10)
        self._set()
        values[output] = value
        return None

    def _divider(self, name: str, query: bool, arguments: list[str]) -> str | None:
        values = self.settings.prescale if name == "PRES" else self.settings.phase
        _count(arguments, 1 if query else 2)
        output = _index(arguments[0], 4)
        if query:
            return str(values[output])
        most = (2**30 - 1 if output == 0 else 2**16 - 1) if name == "PRES" else 2**16 - 1
        value = _read(_Number(Decimal(1), 1, 1 if name == "PRES" else 0, most, 0), arguments[1], 10)
        self._set()
        values[output] = value
        return None

    def _delay(self, name: str, query: bool, arguments: list[str]) -> str | None:
        _count(arguments, 1 if query else 3)
        edge = _index(arguments[0], 9)
        if query:
            reference, after = self.settings.delays[edge]
            return f"{reference},{_write(_TIME, after)}"
        reference = _index(arguments[1], 9)
        after = _read(_Number(_PS, STEP_PS, -_LONGEST_PS, _LONGEST_PS, 12), arguments[2], 12)
        self._hang(edge, reference, after)
        return None

    def _link(self, name: str, query: bool, arguments: list[str]) -> str | None:
        _count(arguments, 1 if query else 2)
        edge = _index(arguments[0], 9)
        if query:
            return str(self.settings.delays[edge][0])
        reference = _index(arguments[1], 9)
        self._hang(edge, reference, self.absolute_ps(edge) - self.absolute_ps(reference))
        return None

    def _hang(self, edge: int, reference: int, after: int) -> None:
        """Hang an edge on another; every edge that hangs on it moves too, and all must stay legal."""
        if edge < 2 or reference in (1, edge):
            raise _Refusal(13)
        above = reference
        while above:
            above = self.settings.delays[above][0]
            if above == edge:
                raise _Refusal(13)
        self._set()
        before = self.settings.delays[edge]
        self.settings.delays[edge] = (reference, after)
        if not all(0 <= self.absolute_ps(each) <= _LONGEST_PS for each in range(2, 10)):
            self.settings.delays[edge] = before
            raise _Refusal(12)

    def _last_error(self, name: str, query: bool, arguments: list[str]) -> str:
        if not query:
            raise _Refusal(113)
        return str(self.errors.popleft() if self.errors else 0)

    def _register(self, name: str, query: bool, arguments: list[str]) -> str | None:
        key = name.removeprefix("*")
        if query:
            return str(self._status[key])
        _count(arguments, 1)
        self._status[key] = _read(_Number(Decimal(1), 1, 0, 255, 0), arguments[0], 10)
        return None

    def _status_byte(self) -> str:
        byte = 1 if self._status["INSR"] & self._status["INSE"] else 0
        byte |= 2 if self.clock_ps < self._busy_until_ps else 0
        byte |= 32 if self._status["ESR"] & self._status["ESE"] else 0
        return str(byte)

    def _taken(self, register: str) -> str:
        value, self._status[register] = self._status[register], 0
        return str(value)

    def _clear_status(self) -> None:
        self._status.update(ESR=0, INSR=0)
        self.errors.clear()

    def _single_shot(self) -> None:
        if self.settings.numbers["TSRC"] not in (3, 4, 5):
            raise _Refusal(11)
        self._armed_once = True
        if self.settings.numbers["TSRC"] == 5:
            self.trigger("single")

    def _save(self, name: str, query: bool, arguments: list[str]) -> None:
        _count(arguments, 1)
        self._memory[_read(_Number(Decimal(1), 1, 1, 9, 0), arguments[0], 10)] = copy.deepcopy(self.settings)

    def _recall(self, name: str, query: bool, arguments: list[str]) -> None:
        _count(arguments, 1)
        slot = _read(_Number(Decimal(1), 1, 0, 9, 0), arguments[0], 10)
        if slot != 0 and slot not in self._memory:
            raise _Refusal(14)
        self._replace(_Settings() if slot == 0 else self._memory[slot])

    def _replace(self, settings: _Settings) -> None:
        self._set()
        self.settings = copy.deepcopy(settings)

    def _display(self, name: str, query: bool, arguments: list[str]) -> str | None:
        if query:
            return "{},{}".format(*self.settings.display)
        _count(arguments, 2)
        self.settings.display = (_index(arguments[0], 15), _index(arguments[1], 10))
        return None

    def _configuration(self, name: str, query: bool, arguments: list[str]) -> str | None:
        _count(arguments, 1 if query else 2)
        key = _index(arguments[0], 13)
        if query:
            return str(self._interface.get(key, "0.0.0.0"))
        self._interface[key] = _read(_Number(Decimal(1), 1, 0, 2**31, 0), arguments[1], 10)
        return None

    def _step_size(self, name: str, query: bool, arguments: list[str]) -> str | None:
        key = name[2:] + ("," + arguments[0] if len(arguments) > (0 if query else 1) else "")
        if query:
            return str(self.settings.steps.get(key, 1))
        self.settings.steps[key] = _read(_TIME, arguments[-1], 10)
        return None

    def _step(self, name: str, query: bool, arguments: list[str]) -> None:
        if name != "SPDL":
            raise _Refusal(11)
        _count(arguments, 2)
        edge, up = _index(arguments[0], 9), _index(arguments[1], 1)
        reference, after = self.settings.delays[edge]
        size = self.settings.steps.get(f"DL,{edge}", STEP_PS)
        self._hang(edge, reference, after + (size if up else -size))


def _count(arguments: list[str], wanted: int) -> None:
    if len(arguments) != wanted:
        raise _Refusal(116 if len(arguments) < wanted else 115)


def _index(text: str, highest: int) -> int:
    if not re.fullmatch(r"[+-]?\d+", text):
        raise _Refusal(120)
    if not 0 <= int(text) <= highest:
        raise _Refusal(10)
    return int(text)


def _read(number: _Number, text: str, out_of_range: int) -> int:
    try:
        value = Decimal(text)
    except InvalidOperation:
        raise _Refusal(118) from None
    if not value.is_finite():
        raise _Refusal(118)
    units = value * number.scale
    if not number.lowest <= units <= number.highest:
        raise _Refusal(out_of_range)
    return int((units / number.step).to_integral_value()) * number.step


def _write(number: _Number, value: int) -> str:
    text = f"{Decimal(value) / number.scale:.{number.decimals}f}"
    return text if number.decimals == 0 or text.startswith("-") else f"+{text}"
