"""A link to a simulated generator in this process: what a dry run talks to, in the place of a port."""

from __future__ import annotations

from rig.errors import LinkError
from rig.simulator.faults import Device
from rig.simulator.lines import CommandSplitter


class DryRunLink:
    """Answers at once, as the model would; no port, no time.

    Parameters
    ----------
    device : Device
    """

    name = "dry run"

    def __init__(self, device: Device) -> None:
        self.device = device
        self._splitter = CommandSplitter(self.device.separators, self.device.input_limit)
        self._replies = bytearray()

    def open(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def write(self, block: bytes) -> None:
        """Let the device obey."""
        for command in self._splitter.take(block):
            reply = self.device.feed(command)
            if reply is not None:
                self._replies += reply.encode("latin-1") + self.device.terminator.encode()

    def read_line(self, deadline: float) -> bytes:
        """Return the next reply, whole."""
        end = self._replies.find(b"\n")
        if end < 0:
            raise LinkError("dry run: the simulated generator has nothing to say")
        line = bytes(self._replies[: end + 1])
        del self._replies[: end + 1]
        return line

    def drain(self, silence_s: float, deadline: float) -> bytes:
        """Return everything at once."""
        heard = bytes(self._replies)
        self._replies.clear()
        return heard

    def pending(self) -> bytes:
        """Return everything at once."""
        return self.drain(0.0, 0.0)
