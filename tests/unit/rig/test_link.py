"""The only module that knows pyserial: deadlines, halves, hang-ups, and a port over RFC 2217."""

from __future__ import annotations

import os
import socket
import threading
import time
import tty
from collections.abc import Iterator

import pytest
import serial
import serial.rfc2217

import rig
from rig.errors import LinkError
from rig.link import SerialLink


@pytest.fixture
def line() -> Iterator[tuple[SerialLink, int]]:
    """An open link on a pty, and the file at its other end."""
    ours, theirs = os.openpty()
    tty.setraw(ours)
    tty.setraw(theirs)
    link = SerialLink(os.ttyname(theirs), 115200)
    link.open()
    yield link, ours
    link.close()
    os.close(theirs)
    os.close(ours)


def test_a_line_comes_whole_however_it_is_cut(line: tuple[SerialLink, int]) -> None:
    link, far = line
    threading.Thread(
        target=lambda: [(time.sleep(0.03), os.write(far, piece)) for piece in (b"+1", b"0\r", b"\n7")]
    ).start()
    assert link.read_line(link.now() + 2) == b"+10\r\n"
    assert link.read_line(link.now() + 0.1) == b"7"
    assert link.read_line(link.now() + 0.05) == b""


def test_the_deadline_holds_while_bytes_trickle(line: tuple[SerialLink, int]) -> None:
    """pyserial's own time-out starts anew between bytes."""
    link, far = line
    stop = threading.Event()

    def trickle() -> None:
        while not stop.wait(0.05):
            os.write(far, b"x")

    thread = threading.Thread(target=trickle)
    thread.start()
    begin = time.monotonic()
    assert set(link.read_line(begin + 0.3)) == {ord("x")}
    assert time.monotonic() - begin < 1.0
    with pytest.raises(LinkError, match="talks without end"):
        link.drain(0.2, link.now() + 0.4)
    stop.set()
    thread.join()


def test_silence_is_waited_for_and_strays_are_seen(line: tuple[SerialLink, int]) -> None:
    link, far = line
    os.write(far, b"stale\r\n")
    time.sleep(0.05)
    assert link.pending() == b"stale\r\n"
    assert link.pending() == b""
    os.write(far, b"late")
    assert link.drain(0.05, link.now() + 1) == b"late"


def test_a_port_closed_under_the_feet_is_one_kind_of_failure(line: tuple[SerialLink, int]) -> None:
    link, _ = line
    link.close()
    link.close()
    for act in (lambda: link.write(b"x"), link.pending, lambda: link.read_line(link.now() + 1)):
        with pytest.raises(LinkError):
            act()


def test_a_device_that_vanishes_is_one_kind_of_failure() -> None:
    ours, theirs = os.openpty()
    link = SerialLink(os.ttyname(theirs), 9600)
    link.open()
    os.close(theirs)
    os.close(ours)
    for act in (lambda: link.write(b"x"), link.pending, lambda: link.read_line(link.now() + 0.2)):
        with pytest.raises(LinkError):
            act()
    link.close()


class PtyPort(serial.Serial):  # type: ignore[misc]
    """A pty has no modem lines; an RFC 2217 server asks for them."""

    cts = dsr = ri = cd = True

    def _update_rts_state(self) -> None:
        pass

    def _update_dtr_state(self) -> None:
        pass


class Rfc2217Server:
    """One serial device offered over the network, as pyserial's own example does it."""

    def __init__(self, device: str) -> None:
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = PtyPort(device, timeout=0.01)
        self.stop = threading.Event()
        self.thread = threading.Thread(target=self.serve)
        self.thread.start()

    def serve(self) -> None:
        self.listener.settimeout(10)
        connection, _ = self.listener.accept()
        connection.settimeout(0.01)
        outer = self

        class Writer:
            def write(self, data: bytes) -> None:
                connection.sendall(data)

        manager = serial.rfc2217.PortManager(self.port, Writer())
        with connection:
            while not outer.stop.is_set():
                heard = self.port.read(self.port.in_waiting or 1)
                if heard:
                    connection.sendall(b"".join(manager.escape(heard)))
                try:
                    data = connection.recv(1024)
                except TimeoutError:
                    continue
                except OSError:
                    return
                if not data:
                    return
                self.port.write(b"".join(manager.filter(data)))

    def close(self) -> None:
        self.stop.set()
        self.thread.join()
        self.port.close()
        self.listener.close()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # pyserial's rfc2217 uses setDaemon
def test_a_gate_is_applied_over_rfc2217() -> None:
    with rig.simulate("dg645", tcp=None, pty=True) as simulated:
        server = Rfc2217Server(simulated.pty_name)
        try:
            port = f"rfc2217://127.0.0.1:{server.listener.getsockname()[1]}"
            with rig.open_generator(port, timeout="3 s") as box:
                assert box.apply(rig.plan_gate("40 m")).delay_ps == 277_115
        finally:
            server.close()
        assert simulated.device.feed("DLAY?2") == "0,+0.000000277115"
