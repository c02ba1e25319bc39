"""Simulated generators on a pty or a TCP port of this machine: one thread, one loop, honest time.

With a baud rate every byte takes ten bits of wire time in both directions, so that the duration of a
scan is what a real line would give. A second port, the side door, switches faults while it runs: one
command a line, one JSON object back (``docs/gate.md``).
"""

from __future__ import annotations

import contextlib
import functools
import heapq
import itertools
import os
import selectors
import socket
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from rig.errors import Fault, LinkError, PlanError
from rig.simulator.faults import Chunk, Device, Faults
from rig.simulator.lines import CommandSplitter
from rig.simulator.side_door import answer


class _Line:
    """One connection: its bytes in, its bytes out, and when each direction is free again."""

    def __init__(self, device: Device, send: Callable[[bytes], None], close: Callable[[], None]) -> None:
        self.splitter = CommandSplitter(device.separators, device.input_limit)
        self.send = send
        self.close = close
        self.input_free = 0.0
        self.output_free = 0.0


class SimulatorServer:
    """Serve one simulated generator.

    Parameters
    ----------
    device : Device
    tcp : str, optional
        ``host:port`` to listen on; port 0 takes a free one.
    pty : bool
        Open a pseudo-terminal.
    baud : int, optional
        Pace the bytes; without it they pass at once.
    seed : int
        Of the faults.
    symlink : path-like, optional
        A fixed name for the pty.
    """

    def __init__(
        self,
        device: Device,
        *,
        tcp: str | None = "127.0.0.1:0",
        pty: bool = False,
        baud: int | None = None,
        seed: int = 0,
        symlink: str | os.PathLike[str] | None = None,
    ) -> None:
        self.device: Device = device
        self.faults: Faults = Faults(device, seed=seed)
        self.pty_name = ""
        self.received = bytearray()
        self._byte_s = 0.0 if baud is None else 10.0 / baud
        self._symlink = None if symlink is None else Path(symlink)
        self._selector = selectors.SelectSelector()  # epoll rounds its waits up to whole milliseconds
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._connections: dict[socket.socket, _Line] = {}
        self._pty: tuple[int, int] | None = None
        self._thread: threading.Thread | None = None
        self._stopping = False
        self._tcp = None if tcp is None else _address(tcp)
        self._wants_pty = pty
        self._listener: socket.socket | None = None
        self._door: socket.socket | None = None
        self._wake: socket.socket | None = None
        self._waker: socket.socket | None = None

    @property
    def address(self) -> tuple[str, int] | None:
        """Host and port that the generator listens on."""
        return None if self._listener is None else self._listener.getsockname()[:2]

    @property
    def url(self) -> str:
        """What ``open_generator`` takes."""
        if self.address is None:
            return self.pty_name
        return "socket://{}:{}".format(*self.address)

    @property
    def side_door(self) -> tuple[str, int]:
        """Host and port of the side door."""
        if self._door is None:
            raise LinkError("simulated generator: not open; wanted open() or a with block")
        host, port = self._door.getsockname()[:2]
        return host, port

    def open(self) -> None:
        """Take the ports.

        Raises
        ------
        PlanError
            If a port is taken.
        """
        wake, self._waker = socket.socketpair()
        self._wake = wake
        self._selector.register(wake, selectors.EVENT_READ, lambda: wake.recv(64))
        try:
            if self._tcp is not None:
                self._listener = self._listen(self._tcp, self._accept)
            self._door = self._listen(("127.0.0.1", 0), self._accept_at_side_door)
            if self._wants_pty:
                self._open_pty()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        self.open()
        self._thread = threading.Thread(target=self.run, name="simulated generator", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
        if self._thread is not None:
            self._thread.join()
        self.close()

    def run(self) -> None:
        """Serve until ``stop``."""
        while not self._stopping:
            wait = None if not self._events else max(0.0, self._events[0][0] - time.monotonic())
            for key, _ in self._selector.select(wait):
                key.data()
            while self._events and self._events[0][0] <= time.monotonic():
                heapq.heappop(self._events)[2]()

    def stop(self) -> None:
        """End ``run``; from any thread."""
        self._stopping = True
        self._wake_up()

    def _wake_up(self) -> None:
        if self._waker is not None:
            with contextlib.suppress(OSError):
                self._waker.send(b"x")

    def close(self) -> None:
        """Close every port; the pty's symlink goes with it."""
        for connection in list(self._connections):
            self._drop(connection)
        for listener in (self._listener, self._door, self._wake, self._waker):
            if listener is not None:
                listener.close()
        self._close_pty()
        self._selector.close()

    def unplug(self, seconds: float) -> None:
        """Drop every connection and refuse new ones for a while; from any thread."""
        self._at(0.0, functools.partial(self._unplug, seconds))
        self._wake_up()

    def _unplug(self, seconds: float) -> None:
        for connection in list(self._connections):
            self._drop(connection)
        if self._pty is not None:
            self._close_pty()
            self._at(seconds, self._open_pty)
        if self._listener is not None:
            address = self._listener.getsockname()[:2]
            self._selector.unregister(self._listener)
            self._listener.close()
            self._at(seconds, lambda: self._plug_in(address))

    def _plug_in(self, address: tuple[str, int]) -> None:
        self._listener = self._listen(address, self._accept)

    def _listen(self, address: tuple[str, int], accept: Callable[[socket.socket], None]) -> socket.socket:
        try:
            listener = socket.create_server(address)
        except OSError as error:
            fault = Fault("tcp", f"{address[0]}:{address[1]}", "a free port of this machine", str(error))
            raise PlanError("simulated generator", [fault]) from error
        self._selector.register(listener, selectors.EVENT_READ, lambda: accept(listener))
        return listener

    def _accept(self, listener: socket.socket) -> None:
        connection, _ = listener.accept()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        line = _Line(self.device, connection.sendall, lambda: self._drop(connection))
        self._connections[connection] = line
        self._selector.register(connection, selectors.EVENT_READ, lambda: self._read(connection, line))

    def _read(self, connection: socket.socket, line: _Line) -> None:
        try:
            data = connection.recv(4096)
        except OSError:
            data = b""
        if data:
            self._take(line, data)
        else:
            self._drop(connection)

    def _drop(self, connection: socket.socket) -> None:
        if connection in self._connections:
            del self._connections[connection]
            self._selector.unregister(connection)
            connection.close()

    def _open_pty(self) -> None:
        ours, theirs = os.openpty()
        tty.setraw(ours)
        tty.setraw(theirs)
        os.set_blocking(ours, False)
        self._pty = (ours, theirs)  # theirs stays open, or reading ours fails between two clients
        self.pty_name = os.ttyname(theirs)
        line = _Line(self.device, lambda data: _write_or_lose(ours, data), lambda: self.unplug(0.5))
        self._selector.register(ours, selectors.EVENT_READ, lambda: self._read_pty(ours, line))
        if self._symlink is not None:
            self._symlink.unlink(missing_ok=True)
            self._symlink.symlink_to(self.pty_name)

    def _read_pty(self, ours: int, line: _Line) -> None:
        with contextlib.suppress(OSError):
            self._take(line, os.read(ours, 4096))

    def _close_pty(self) -> None:
        if self._pty is not None:
            self._selector.unregister(self._pty[0])
            for end in self._pty:
                os.close(end)
            self._pty = None
            if self._symlink is not None:
                self._symlink.unlink(missing_ok=True)

    def _take(self, line: _Line, data: bytes) -> None:
        self.received += data
        now = time.monotonic()
        for byte in data:
            line.input_free = max(now, line.input_free) + self._byte_s
            for command in line.splitter.take(bytes([byte])):
                self._at_time(line.input_free, functools.partial(self._obey, line, command, line.input_free))
        if line.splitter.overflowed:
            line.splitter.overflowed = False
            self.device.complain(171)

    def _obey(self, line: _Line, command: str, heard: float) -> None:
        """Run a command and send its reply, timed from when its last byte had come, however late it is."""
        for chunk in self.faults.run(command):
            self._reply(line, chunk, heard)

    def _reply(self, line: _Line, chunk: Chunk, heard: float) -> None:
        begin = (heard if chunk.out_of_order else max(heard, line.output_free)) + chunk.pause_s
        end = begin + len(chunk.data) * self._byte_s
        if not chunk.out_of_order:
            line.output_free = end

        def send() -> None:
            with contextlib.suppress(OSError):
                line.send(chunk.data)
            if chunk.hang_up:
                line.close()

        self._at_time(end, send)

    def _at(self, seconds: float, act: Callable[[], None]) -> None:
        self._at_time(time.monotonic() + seconds, act)

    def _at_time(self, when: float, act: Callable[[], None]) -> None:
        heapq.heappush(self._events, (when, next(self._order), act))

    def _accept_at_side_door(self, listener: socket.socket) -> None:
        connection, _ = listener.accept()
        splitter = CommandSplitter("\n", 4096)

        def read() -> None:
            try:
                data = connection.recv(4096)
                for command in splitter.take(data):
                    connection.sendall((answer(self, command.strip()) + "\n").encode())
            except OSError:
                data = b""
            if not data:
                self._selector.unregister(connection)
                connection.close()

        self._selector.register(connection, selectors.EVENT_READ, read)


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not port.isdigit() or int(port) > 65535:
        raise PlanError("simulated generator", [Fault("tcp", repr(text), "HOST:PORT, such as 127.0.0.1:0")])
    return host or "127.0.0.1", int(port)


def _write_or_lose(file: int, data: bytes) -> None:
    """Write to a pty; what does not fit because nobody reads is lost, as on a wire."""
    with contextlib.suppress(BlockingIOError):
        os.write(file, data)
