"""A link to a simulated generator in this process, with a clock of its own that no one has to wait for.

A dry run talks to it in the place of a port, through the same code. With faults it stands for a bad
line, thousands of times a second: time passes only where a reader would wait.
"""

from __future__ import annotations

from rig.errors import LinkError
from rig.simulator.faults import Device, Faults
from rig.simulator.lines import CommandSplitter


class DryRunLink:
    """A generator that is not there.

    Parameters
    ----------
    device : Device
    faults : Faults, optional
        Of this device.
    """

    name = "dry run"

    def __init__(self, device: Device, faults: Faults | None = None) -> None:
        self.device = device
        self.written = bytearray()
        self._faults = faults or Faults(device)
        self._splitter = CommandSplitter(device.separators, device.input_limit)
        self._clock_s = 0.0
        self._output_free_s = 0.0
        self._coming: list[tuple[float, int, bytes]] = []  # when, in which order, what
        self._arrived = bytearray()
        self._plugged_in = True

    def now(self) -> float:
        """Return the virtual time in seconds."""
        return self._clock_s

    def open(self) -> None:
        """Plug in."""
        self._plugged_in = True

    def close(self) -> None:
        """Forget what was on its way."""
        self._coming.clear()
        self._arrived.clear()

    def write(self, block: bytes) -> None:
        """Let the device obey."""
        self._check_plug()
        self.written += block
        for command in self._splitter.take(block):
            for chunk in self._faults.run(command):
                begin = self._clock_s if chunk.out_of_order else max(self._clock_s, self._output_free_s)
                due = begin + chunk.pause_s
                if not chunk.out_of_order:
                    self._output_free_s = due
                self._coming.append((due, len(self._coming), chunk.data))
                if chunk.hang_up:
                    self._plugged_in = False
                    return

    def read_line(self, deadline: float) -> bytes:
        """Return the next line, or what there is of it when the deadline passes."""
        while True:
            self._receive()
            end = self._arrived.find(b"\n")
            if end >= 0:
                line = bytes(self._arrived[: end + 1])
                del self._arrived[: end + 1]
                return line
            if not self._wait_until(deadline):
                return self._all()

    def drain(self, silence_s: float, deadline: float) -> bytes:
        """Read until the line was silent for so long."""
        heard = bytearray()
        while True:
            self._receive()
            heard += self._all()
            if not self._wait_until(self._clock_s + silence_s):
                return bytes(heard)
            if self._clock_s > deadline:
                raise LinkError("dry run: talks without end; wanted silence")

    def pending(self) -> bytes:
        """Return what has arrived."""
        self._receive()
        return self._all()

    def _all(self) -> bytes:
        arrived = bytes(self._arrived)
        self._arrived.clear()
        return arrived

    def _receive(self) -> None:
        self._check_plug()
        arrived = sorted(chunk for chunk in self._coming if chunk[0] <= self._clock_s)
        self._coming = [chunk for chunk in self._coming if chunk[0] > self._clock_s]
        for _, _, data in arrived:
            self._arrived += data

    def _wait_until(self, deadline: float) -> bool:
        """Let time pass to the next byte and say True, or to the deadline and say False."""
        due = min((when for when, _, _ in self._coming), default=deadline + 1)
        self._clock_s = max(self._clock_s, min(due, deadline))
        return due <= deadline

    def _check_plug(self) -> None:
        if not self._plugged_in:
            raise LinkError("dry run: the port is gone")
