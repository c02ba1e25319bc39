"""The status of a simulated DG645: its registers and its queue of errors (manual p. 48-51, 60-67)."""

from __future__ import annotations

from collections import deque

_QUEUE_LENGTH = 20
_TOO_MANY = 254
_LOWEST_PARSE_ERROR = 110
_EXECUTION, _PARSING, POWER_ON = 1 << 4, 1 << 5, 1 << 7
TRIGGERED, RATE_ERROR, END_OF_DELAY, ABORTED = 1 << 0, 1 << 1, 1 << 2, 1 << 5


class Status:
    """Registers that reading clears, their enable masks, and the queue that ``LERR?`` empties."""

    def __init__(self) -> None:
        self.registers = {"ESR": POWER_ON, "INSR": 0, "ESE": 0, "SRE": 0, "INSE": 0, "PSC": 1}
        self._errors: deque[int] = deque()

    def complain(self, code: int) -> None:
        """Queue an error; the twentieth says that more were lost."""
        if len(self._errors) < _QUEUE_LENGTH:
            self._errors.append(code if len(self._errors) < _QUEUE_LENGTH - 1 else _TOO_MANY)
        self.registers["ESR"] |= _PARSING if code >= _LOWEST_PARSE_ERROR else _EXECUTION

    def next_error(self) -> int:
        """Return the oldest error, or 0."""
        return self._errors.popleft() if self._errors else 0

    def note(self, bits: int) -> None:
        """Set bits of the instrument's register."""
        self.registers["INSR"] |= bits

    def take(self, name: str) -> int:
        """Return a register and clear it."""
        value, self.registers[name] = self.registers[name], 0
        return value

    def byte(self, *, busy: bool) -> int:
        """Return what ``*STB?`` tells."""
        held = self.registers
        summary = 1 if held["INSR"] & held["INSE"] else 0
        return summary | (2 if busy else 0) | (32 if held["ESR"] & held["ESE"] else 0)

    def clear(self) -> None:
        """Clear registers and queue, not the masks."""
        self.registers.update(ESR=0, INSR=0)
        self._errors.clear()

    def power_up(self) -> None:
        """Start again, with the bit that says so."""
        self.clear()
        self.registers["ESR"] = POWER_ON
