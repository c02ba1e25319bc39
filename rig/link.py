"""Bytes to and from a port, with deadlines of our own. The only module that knows pyserial.

pyserial 3.5 as it behaves: a time-out returns half a reply without a word and hands the rest to the
next caller; ``read_until`` checks its time-out between bytes only; ``in_waiting`` on a vanished device
raises ``OSError``, a flush ``termios.error``; a socket's ``in_waiting`` is 0 or 1. So this reader keeps
its own buffer, reads in short slices against a monotonic deadline, and turns every failure into one kind.
"""

from __future__ import annotations

import contextlib
import termios
import time
from collections.abc import Iterator
from typing import Any, Protocol

from rig.errors import LinkError

_SLICE_S = 0.02
_WRITE_TIMEOUT_S = 2.0


class Link(Protocol):
    """What a conversation needs of a port."""

    name: str

    def now(self) -> float:
        """Return the time that deadlines are in, in seconds."""

    def open(self) -> None:
        """Open the port; nothing is sent."""

    def write(self, block: bytes) -> None:
        """Send a block whole."""

    def read_line(self, deadline: float) -> bytes:
        """Return the next line, or what there is of it at the deadline."""

    def drain(self, silence_s: float, deadline: float) -> bytes:
        """Read until the line was silent."""

    def pending(self) -> bytes:
        """Return what has arrived unasked, without waiting."""

    def close(self) -> None:
        """Close the port; never raises."""


@contextlib.contextmanager
def _one_kind_of_failure(name: str, doing: str) -> Iterator[None]:
    import serial

    try:
        yield
    except LinkError:
        raise
    except (
        serial.SerialException,
        OSError,
        termios.error,
        ValueError,
        AttributeError,
        TypeError,
        NotImplementedError,
    ) as error:
        # pyserial raises TypeError or AttributeError when a port is closed under its feet.
        reason = str(error) or type(error).__name__
        raise LinkError(
            f"{name}: {doing} failed: {reason}. Check the cable, the power and the port."
        ) from error


class SerialLink:
    """A port that pyserial can open: a device, a pty, ``socket://host:port``, ``rfc2217://host:port``.

    Parameters
    ----------
    name : str
        The port.
    baud : int
        Of a serial device; sockets ignore it.
    """

    def __init__(self, name: str, baud: int) -> None:
        self.name = name
        self.baud = baud
        self._port: Any = None
        self._buffer = bytearray()

    def open(self) -> None:
        """Open the port; nothing is sent."""
        import serial

        # pyserial's rfc2217 knows no write time-out and refuses to open with one.
        write_timeout = None if self.name.startswith("rfc2217:") else _WRITE_TIMEOUT_S
        with _one_kind_of_failure(self.name, "opening"):
            self._port = serial.serial_for_url(
                self.name, baudrate=self.baud, timeout=_SLICE_S, write_timeout=write_timeout
            )

    def now(self) -> float:
        """Return the monotonic time."""
        return time.monotonic()

    def close(self) -> None:
        """Close the port; never raises, safe to call twice."""
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(Exception):
                port.close()

    def write(self, block: bytes) -> None:
        """Send a block whole."""
        with _one_kind_of_failure(self.name, "sending"):
            sent = self._open_port().write(block)
            if sent is not None and sent != len(block):
                raise LinkError(f"{self.name}: {sent} of {len(block)} bytes went out")

    def read_line(self, deadline: float) -> bytes:
        """Return the next line up to and including LF, or what there is of it when the deadline passes.

        What does not end in LF is no reply; the caller must say so.
        """
        while True:
            end = self._buffer.find(b"\n")
            if end >= 0:
                line = bytes(self._buffer[: end + 1])
                del self._buffer[: end + 1]
                return line
            if time.monotonic() >= deadline:
                cut = bytes(self._buffer)
                self._buffer.clear()
                return cut
            self._fill()

    def drain(self, silence_s: float, deadline: float) -> bytes:
        """Read and return everything until the line was silent for ``silence_s``.

        Raises
        ------
        LinkError
            If it never falls silent before the deadline.
        """
        heard = bytearray(self._buffer)
        self._buffer.clear()
        quiet_since = time.monotonic()
        while (now := time.monotonic()) - quiet_since < silence_s:
            if now > deadline:
                raise LinkError(f"{self.name}: talks without end ({bytes(heard[-40:])!r}); wanted silence")
            self._fill()
            if self._buffer:
                heard += self._buffer
                self._buffer.clear()
                quiet_since = time.monotonic()
        return bytes(heard)

    def pending(self) -> bytes:
        """Return what has arrived unasked, without waiting."""
        with _one_kind_of_failure(self.name, "looking at the input"):
            port = self._open_port()
            while waiting := port.in_waiting:
                self._buffer += port.read(waiting)
        heard = bytes(self._buffer)
        self._buffer.clear()
        return heard

    def _fill(self) -> None:
        with _one_kind_of_failure(self.name, "reading"):
            port = self._open_port()
            self._buffer += port.read(port.in_waiting or 1)

    def _open_port(self) -> Any:
        if self._port is None:
            raise LinkError(f"{self.name}: the port is closed; wanted an open one")
        return self._port
