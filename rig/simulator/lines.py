"""From bytes to commands: the input buffer of a device, one per connection."""

from __future__ import annotations


class CommandSplitter:
    """Collects bytes and gives out whole commands.

    Parameters
    ----------
    separators : str
        Each of these characters ends a command.
    limit : int
        Bytes that the device can hold; more without a separator are lost with what came before.
    """

    def __init__(self, separators: str, limit: int) -> None:
        self._separators = separators.encode()
        self._limit = limit
        self._held = bytearray()
        self.overflowed = False

    def take(self, data: bytes) -> list[str]:
        """Take bytes in; return the commands that they complete."""
        commands = []
        for byte in data:
            if byte in self._separators:
                commands.append(self._held.decode("latin-1"))
                self._held.clear()
            elif len(self._held) >= self._limit:
                self._held.clear()
                self.overflowed = True
            else:
                self._held.append(byte)
        return commands
