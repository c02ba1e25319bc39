"""A simulated DG645: the device alone, without any line, clock or thread of its own.

``feed`` takes one command and returns its reply, or None. Written from the manual (rev. 1.1, p. 27-67).
What the manual leaves open is decided here: ``LERR?`` answers first in, first out; remote values are
rounded to the grid as the panel's are; a refused command changes nothing.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable
from decimal import Decimal

from rig.simulator.dg645_status import ABORTED, END_OF_DELAY, RATE_ERROR, TRIGGERED, Status
from rig.simulator.dg645_values import (
    ANY_DELAY,
    LEVELS,
    LONGEST_PS,
    NUMBERS,
    STEPPED,
    TIME,
    Refusal,
    Settings,
    check_count,
    index,
    whole,
)
from rig.simulator.edges import Edge, PulseOutput

_COMMAND = re.compile(r"(\*[A-Za-z]{3}|[A-Za-z]{4})(\??)\s*(.*)")
_INTERFACE = {0: 1, 1: 9600, 2: 1, 3: 15, 4: 1, 5: 1, 6: 1, 7: 1, 8: 1, 9: 1, 10: 1}
_CYCLE_PS = 100_000  # beyond the longest delay, before the next trigger


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
        self.status = Status()
        self.locked = False
        self._busy_until_ps = -1
        self._armed_once = False
        self._memory: dict[int, Settings] = {}
        self._interface = dict(_INTERFACE)
        self.settings = Settings()
        self._commands = self._command_table()

    def feed(self, line: str) -> str | None:
        """Run one command; return its reply without a terminator, or None."""
        if not line.strip():
            return None
        try:
            return self._run(line.strip())
        except Refusal as refusal:
            self.complain(refusal.code)
            return None

    def complain(self, code: int) -> None:
        """Put an error on the queue."""
        self.status.complain(code)

    def power_cycle(self) -> None:
        """Lose everything that was not saved: the settings of power-up, and the power-on bit."""
        self.settings = copy.deepcopy(self._memory.get(0, Settings()))
        self.status.power_up()

    def absolute_ps(self, edge: int) -> int:
        """Return when an edge comes after T0, along its links."""
        reference, after = self.settings.delays[edge]
        return after if reference == 0 or edge == 0 else after + self.absolute_ps(reference)

    def resolution(self, line: str) -> Decimal:
        """Return the step, in the wire's unit, of the last number in a set."""
        name = line[:4].upper()
        number = NUMBERS.get(name) or (LEVELS[name][1] if name in LEVELS else TIME)
        return number.step / number.scale

    @property
    def longest_ps(self) -> int:
        """The last edge of a cycle."""
        return max(self.absolute_ps(edge) for edge in range(2, 10))

    @property
    def busy(self) -> bool:
        """Whether a cycle runs."""
        return self.clock_ps < self._busy_until_ps

    def trigger(self, source: str = "external rising") -> bool:
        """Give a trigger at the virtual clock's time; return whether a cycle began."""
        wanted = {
            "internal": (0,), "external rising": (1, 3), "external falling": (2, 4), "single": (5,),
            "line": (6,),
        }[source]  # fmt: skip
        mode = self.settings.numbers["TSRC"]
        if mode not in wanted or (mode in (3, 4, 5) and not self._armed_once):
            return False
        if self.busy:
            self.status.note(RATE_ERROR)
            return False
        self._armed_once = False
        self.status.note(TRIGGERED)
        for name, rise in (("AB", 2), ("CD", 4), ("EF", 6), ("GH", 8)):
            inverted = self.settings.polarity[rise // 2] == 0
            pulse = PulseOutput(name, self.absolute_ps(rise), self.absolute_ps(rise + 1), inverted)
            self.edges += pulse.edges(self.clock_ps)
        self._busy_until_ps = self.clock_ps + _CYCLE_PS + self.longest_ps
        return True

    def advance(self, picoseconds: int) -> None:
        """Let the virtual clock run."""
        self.clock_ps += picoseconds
        if 0 <= self._busy_until_ps <= self.clock_ps:
            self.status.note(END_OF_DELAY)
            self._busy_until_ps = -1

    def _run(self, line: str) -> str | None:
        matched = _COMMAND.fullmatch(line)
        if matched is None:
            raise Refusal(110)
        name, query, rest = matched[1].upper(), bool(matched[2]), matched[3]
        arguments = [part.strip() for part in rest.split(",")] if rest else []
        if any(len(part) > 25 for part in arguments):
            raise Refusal(117)
        if "" in arguments:
            raise Refusal(114)
        handler = self._commands.get(name)
        if handler is None:
            raise Refusal(111)
        return handler(name, query, arguments)

    def _command_table(self) -> dict[str, Callable[[str, bool, list[str]], str | None]]:
        table: dict[str, Callable[[str, bool, list[str]], str | None]] = {
            "DLAY": self._delay, "LINK": self._link, "PRES": self._divider,
            "PHAS": self._divider, "DISP": self._display, "IFCF": self._configuration, "*SAV": self._save,
            "*RCL": self._recall,
        }  # fmt: skip
        table |= dict.fromkeys(NUMBERS, self._number)
        table |= dict.fromkeys(LEVELS, self._level)
        table |= dict.fromkeys(("*ESE", "*SRE", "*PSC", "INSE"), self._register)
        table |= {f"SS{name}": self._step_size for name in STEPPED}
        table |= {f"SP{name}": self._step for name in STEPPED}
        table |= {
            "*IDN": self._asked(lambda: f"Stanford Research Systems,DG645,s/n{self.serial},ver1.14.10E"),
            "LERR": self._asked(lambda: str(self.status.next_error())),
            "*STB": self._asked(lambda: str(self.status.byte(busy=self.busy))),
            "*ESR": self._asked(lambda: str(self.status.take("ESR"))),
            "INSR": self._asked(lambda: str(self.status.take("INSR"))),
            "*TST": self._asked(lambda: "0"),
            "*CAL": self._asked(lambda: "0"),
            "TIMB": self._asked(lambda: "0"),
            "EMAC": self._asked(lambda: "00:19:B3:00:00:00"),
            "LOCK": self._asked(lambda: "1"),
            "UNLK": self._asked(lambda: "1"),
            "*RST": self._told(lambda: self._replace(Settings())),
            "*CLS": self._told(self.status.clear),
            "*TRG": self._told(self._single_shot),
            **{name: self._told(lambda: None) for name in ("*WAI", "REMT", "LCAL", "IFRS", "XTRM", "EPHY")},
            "*OPC": lambda name, query, arguments: "1" if query else None,
        }
        return table

    @staticmethod
    def _asked(answer: Callable[[], str]) -> Callable[[str, bool, list[str]], str]:
        def handler(name: str, query: bool, arguments: list[str]) -> str:
            if not query:
                raise Refusal(113)
            return answer()

        return handler

    def _told(self, act: Callable[[], None]) -> Callable[[str, bool, list[str]], None]:
        def handler(name: str, query: bool, arguments: list[str]) -> None:
            if query:
                raise Refusal(112)
            act()

        return handler

    def _set(self) -> None:
        """Refuse a set while another interface holds the lock; note a cycle cut short."""
        if self.locked:
            raise Refusal(15)
        if self.busy:
            self.status.note(ABORTED)
            self._busy_until_ps = -1

    def _number(self, name: str, query: bool, arguments: list[str]) -> str | None:
        number = NUMBERS[name]
        if query:
            check_count(arguments, 0)
            return number.write(self.settings.numbers[name])
        check_count(arguments, 1)
        value = number.read(arguments[0])
        self._set()
        self.settings.numbers[name] = value
        return None

    def _level(self, name: str, query: bool, arguments: list[str]) -> str | None:
        place, number = LEVELS[name]
        values: list[int] = getattr(self.settings, place)
        check_count(arguments, 1 if query else 2)
        output = index(arguments[0], 4)
        if query:
            return number.write(values[output])
        value = number.read(arguments[1])
        levels = {
            "amplitude": self.settings.amplitude[output],
            "offset": self.settings.offset[output],
            place: value,
        }
        if levels["amplitude"] + levels["offset"] >= 6000:
            raise Refusal(10)
        self._set()
        values[output] = value
        return None

    def _divider(self, name: str, query: bool, arguments: list[str]) -> str | None:
        values = self.settings.prescale if name == "PRES" else self.settings.phase
        check_count(arguments, 1 if query else 2)
        output = index(arguments[0], 4)
        if query:
            return str(values[output])
        most = (2**30 - 1 if output == 0 else 2**16 - 1) if name == "PRES" else 2**16 - 1
        value = whole(1 if name == "PRES" else 0, most).read(arguments[1])
        self._set()
        values[output] = value
        return None

    def _delay(self, name: str, query: bool, arguments: list[str]) -> str | None:
        check_count(arguments, 1 if query else 3)
        edge = index(arguments[0], 9)
        if query:
            reference, after = self.settings.delays[edge]
            return f"{reference},{TIME.write(after)}"
        reference = index(arguments[1], 9)
        after = ANY_DELAY.read(arguments[2], 12)
        self._hang(edge, reference, after)
        return None

    def _link(self, name: str, query: bool, arguments: list[str]) -> str | None:
        check_count(arguments, 1 if query else 2)
        edge = index(arguments[0], 9)
        if query:
            return str(self.settings.delays[edge][0])
        reference = index(arguments[1], 9)
        self._hang(edge, reference, self.absolute_ps(edge) - self.absolute_ps(reference))
        return None

    def _hang(self, edge: int, reference: int, after: int) -> None:
        """Hang an edge on another; every edge that hangs on it moves too, and all must stay legal."""
        if edge < 2 or reference in (1, edge):
            raise Refusal(13)
        above = reference
        while above:
            above = self.settings.delays[above][0]
            if above == edge:
                raise Refusal(13)
        self._set()
        before = self.settings.delays[edge]
        self.settings.delays[edge] = (reference, after)
        if not all(0 <= self.absolute_ps(each) <= LONGEST_PS for each in range(2, 10)):
            self.settings.delays[edge] = before
            raise Refusal(12)

    def _register(self, name: str, query: bool, arguments: list[str]) -> str | None:
        key = name.removeprefix("*")
        if query:
            return str(self.status.registers[key])
        check_count(arguments, 1)
        self.status.registers[key] = whole(0, 255).read(arguments[0])
        return None

    def _single_shot(self) -> None:
        if self.settings.numbers["TSRC"] not in (3, 4, 5):
            raise Refusal(11)
        self._armed_once = True
        if self.settings.numbers["TSRC"] == 5:
            self.trigger("single")

    def _save(self, name: str, query: bool, arguments: list[str]) -> None:
        check_count(arguments, 1)
        self._memory[whole(1, 9).read(arguments[0])] = copy.deepcopy(self.settings)

    def _recall(self, name: str, query: bool, arguments: list[str]) -> None:
        check_count(arguments, 1)
        slot = whole(0, 9).read(arguments[0])
        if slot != 0 and slot not in self._memory:
            raise Refusal(14)
        self._replace(Settings() if slot == 0 else self._memory[slot])

    def _replace(self, settings: Settings) -> None:
        self._set()
        self.settings = copy.deepcopy(settings)

    def _display(self, name: str, query: bool, arguments: list[str]) -> str | None:
        if query:
            return "{},{}".format(*self.settings.display)
        check_count(arguments, 2)
        self.settings.display = (index(arguments[0], 15), index(arguments[1], 10))
        return None

    def _configuration(self, name: str, query: bool, arguments: list[str]) -> str | None:
        check_count(arguments, 1 if query else 2)
        key = index(arguments[0], 13)
        if query:
            return str(self._interface.get(key, "0.0.0.0"))
        self._interface[key] = whole(0, 2**31).read(arguments[1])
        return None

    def _step_size(self, name: str, query: bool, arguments: list[str]) -> str | None:
        key = ",".join([name[2:], *(arguments if query else arguments[:-1])])
        if query:
            return f"{self.settings.steps.get(key, Decimal(1)):f}"
        self.settings.steps[key] = Decimal(ANY_DELAY.read(arguments[-1])) / 10**12
        return None

    def _step(self, name: str, query: bool, arguments: list[str]) -> None:
        """Move a setting by its step: what ``?`` answers, and a set, both of its own command."""
        *place, way = arguments or ["", ""]
        size = self.settings.steps.get(",".join([name[2:], *place]), Decimal(1))
        command = STEPPED[name[2:]]
        *reference, value = (self._run(f"{command}?{','.join(place)}") or "").split(",")
        moved = Decimal(value) + (size if index(way, 1) else -size)
        self._run(f"{command}{','.join([*place, *reference, f'{moved:f}'])}")
