"""Faults of a line and of a device, switchable while it runs, each seeded and counted.

A fault acts on the bytes that come in, on the device, or on the replies that go out. ``after`` spares
the first replies (or commands), ``count`` says how often it strikes; -1 means until it is cleared.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from typing import NamedTuple, Protocol

from rig.simulator.edges import Edge


class Device(Protocol):
    """A simulated generator."""

    model: str
    terminator: str
    separators: str
    input_limit: int
    locked: bool
    serial: str
    edges: list[Edge]

    def feed(self, line: str) -> str | None:
        """Run one command; return its reply, or None."""

    def complain(self, code: int) -> None:
        """Put an error on the queue, where there is one."""

    def power_cycle(self) -> None:
        """Lose the power and come back."""

    def resolution(self, line: str) -> Decimal:
        """Return the step, in the wire's unit, of a set's last number."""

    def trigger(self, source: str = "external rising") -> bool:
        """Give a trigger; return whether a cycle began."""

    def advance(self, picoseconds: int) -> None:
        """Let the virtual clock run."""


class Chunk(NamedTuple):
    """Bytes to send, after a pause; ``hang_up`` closes the line behind them."""

    data: bytes
    pause_s: float = 0.0
    hang_up: bool = False
    out_of_order: bool = False


@dataclass
class _Active:
    after: int
    count: int
    argument: float


REPLY_FAULTS = {
    "drop-byte": "one byte of the reply is lost",
    "flip-bit": "one bit of the reply is turned",
    "garbage": "random bytes come before the reply",
    "nul-bytes": "NUL bytes come before the reply",
    "ff-bytes": "0xFF bytes come before the reply",
    "split-reply": "the reply comes in pieces, 30 ms apart",
    "truncate": "the reply is cut, its terminator kept",
    "no-terminator": "the reply comes without its terminator",
    "wrong-terminator": "the reply ends in CR alone",
    "lf-terminator": "the reply ends in LF alone",
    "late-reply": "the reply comes after a pause (argument, s; 4.2), later ones are not held up",
    "slow-reply": "the reply and all behind it come after a pause (argument, s; 4.2)",
    "duplicate-reply": "the reply comes twice",
    "stale-reply": "the reply before this one comes in its place",
    "lost-reply": "the reply is lost",
    "echo": "the command comes back before its reply",
    "unsolicited": "a line that nobody asked for follows the reply",
    "hang-up": "the line is closed in the middle of the reply",
    "baud-mismatch": "every byte arrives as another",
    "busy": "nothing is answered for a while (argument, s; 2)",
}
COMMAND_FAULTS = {
    "drop-command-byte": "one byte of a command is lost",
    "flip-command-bit": "one bit of a command is turned",
    "lost-command": "a command is lost",
    "baud-mismatch-in": "every byte of a command arrives as another",
}
DEVICE_FAULTS = {
    "ignore-set": "a set changes nothing, and nothing is said",
    "stuck-bit": "a set takes a value with one bit wrong",
    "off-by-one": "a set lands one step too high",
    "error-without-refusal": "a set is done and an error reported",
    "queue-overflow": "the error queue overflows",
    "locked": "another interface holds the lock",
    "power-cycle": "the power goes and comes back before a set",
    "mute": "the device answers nothing any more",
}
FAULTS = {**REPLY_FAULTS, **COMMAND_FAULTS, **DEVICE_FAULTS}


class Faults:
    """The faults of one simulated generator.

    Parameters
    ----------
    device : Device
    seed : int
        Of the bytes and bits that are hit.
    """

    def __init__(self, device: Device, *, seed: int = 0) -> None:
        self.device = device
        self._random = random.Random(seed)
        self._active: dict[str, _Active] = {}
        self._last_reply = b""

    def start(self, name: str, *, after: int = 0, count: int = 1, argument: float = 0.0) -> None:
        """Switch a fault on.

        Raises
        ------
        ValueError
            If there is no such fault.
        """
        if name not in FAULTS:
            raise ValueError(f"fault {name!r}; wanted one of {', '.join(FAULTS)}")
        self._active[name] = _Active(after, count, argument)
        if name == "locked":
            self.device.locked = True

    def clear(self) -> None:
        """Switch all faults off."""
        self._active.clear()
        self.device.locked = False

    def active(self) -> list[str]:
        """Return the names of the faults that may still strike."""
        return [name for name, fault in self._active.items() if fault.count]

    def run(self, line: str) -> list[Chunk]:
        """Pass one command through all faults to the device and return what goes out."""
        for name in COMMAND_FAULTS:
            if line.strip() and self._strikes(name):
                line = self._spoil_command(name, line)
        if not line.strip():
            return []
        is_set = "?" not in line
        reply = self._feed(line, is_set)
        if reply is None or self._strikes("mute"):
            return []
        return self._spoil_reply(line, reply)

    def _strikes(self, name: str) -> bool:
        fault = self._active.get(name)
        if fault is None or fault.count == 0:
            return False
        if fault.after > 0:
            fault.after -= 1
            return False
        fault.count -= fault.count > 0
        return True

    def _argument(self, name: str, default: float) -> float:
        return self._active[name].argument or default

    def _spoil_command(self, name: str, line: str) -> str:
        if name == "lost-command":
            return ""
        spoil = {
            "drop-command-byte": self._drop,
            "flip-command-bit": self._flip,
            "baud-mismatch-in": self._scramble,
        }[name]
        return spoil(line.encode("latin-1")).decode("latin-1")

    def _feed(self, line: str, is_set: bool) -> str | None:
        device = self.device
        if is_set and self._strikes("power-cycle"):
            device.power_cycle()
        if is_set and self._strikes("ignore-set"):
            return "ok" if device.model == "bnc575" else None
        if is_set and self._has_number(line):
            if self._strikes("stuck-bit"):
                line = self._shift(line, 1 << self._random.randrange(1, 6))
            if self._strikes("off-by-one"):
                line = self._shift(line, 1)
        reply = device.feed(line)
        if is_set and self._strikes("error-without-refusal"):
            device.complain(10)
            return "?5" if device.model == "bnc575" else reply
        if is_set and self._strikes("queue-overflow"):
            for _ in range(25):
                device.complain(111)
            return "?8" if device.model == "bnc575" else reply
        return reply

    @staticmethod
    def _has_number(line: str) -> bool:
        return re.search(r"\.\d+(?:[eE][+-]?\d+)?$", line.strip()) is not None

    def _shift(self, line: str, steps: int) -> str:
        """Move the last number of a set by whole steps of the device."""
        matched = re.search(r"[+-]?\d*\.\d+(?:[eE][+-]?\d+)?$", line.strip())
        if matched is None:
            return line
        value = Decimal(matched[0]) + steps * self.device.resolution(line)
        return f"{line.strip()[: matched.start()]}{value:.12f}"

    def _spoil_reply(self, line: str, reply: str) -> list[Chunk]:
        end = self.device.terminator.encode()
        text = reply.encode("latin-1")
        before, self._last_reply = self._last_reply, text
        if self._strikes("stale-reply"):
            text = before or text
        for name, spoil in self._text_faults().items():
            if self._strikes(name):
                text = spoil(text)
        for name, other in (("no-terminator", b""), ("wrong-terminator", b"\r"), ("lf-terminator", b"\n")):
            if self._strikes(name):
                end = other
        data = text + end
        if self._strikes("echo"):
            data = line.strip().encode("latin-1") + b"\r\n" + data
        if self._strikes("duplicate-reply"):
            data += data
        if self._strikes("unsolicited"):
            data += b"QC\r\n"
        if self._strikes("baud-mismatch"):
            data = self._scramble(data)
        return self._chunks(data)

    def _text_faults(self) -> dict[str, Callable[[bytes], bytes]]:
        return {
            "drop-byte": self._drop,
            "flip-bit": self._flip,
            "truncate": lambda text: text[: max(1, len(text) // 2)],
            "garbage": lambda text: bytes(self._random.randrange(33, 127) for _ in range(5)) + text,
            "nul-bytes": lambda text: b"\x00\x00" + text,
            "ff-bytes": lambda text: b"\xff\xff" + text,
        }

    def _chunks(self, data: bytes) -> list[Chunk]:
        if self._strikes("lost-reply"):
            return []
        if self._strikes("late-reply"):
            return [Chunk(data, self._argument("late-reply", 4.2), out_of_order=True)]
        if self._strikes("slow-reply"):
            return [Chunk(data, self._argument("slow-reply", 4.2))]
        if self._strikes("busy"):
            return [Chunk(data, self._argument("busy", 2.0))]
        if self._strikes("hang-up"):
            return [Chunk(data[: len(data) // 2], hang_up=True)]
        if self._strikes("split-reply"):
            return [Chunk(data[at : at + 3], 0.03) for at in range(0, len(data), 3)]
        return [Chunk(data)]

    def _drop(self, data: bytes) -> bytes:
        place = self._random.randrange(len(data))
        return data[:place] + data[place + 1 :]

    def _flip(self, data: bytes) -> bytes:
        place = self._random.randrange(len(data))
        return data[:place] + bytes([data[place] ^ (1 << self._random.randrange(7))]) + data[place + 1 :]

    def _scramble(self, data: bytes) -> bytes:
        return bytes((byte * 37 + 11) % 256 for byte in data)
