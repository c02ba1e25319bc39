"""One owner per port: a lock file that the operating system releases when its holder dies.

Two readers on one serial line steal each other's bytes, and pyserial's ``exclusive`` does not stop a
second program that opens without it. ``flock`` on a file beside the port binds everyone who uses this
package, threads of one process included, and a killed owner never leaves a stale lock.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import socket
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from rig.errors import OwnedError


def _lock_path(port: str) -> Path:
    named = os.path.realpath(port) if port.startswith("/") else port.lower()  # /dev/serial/by-id is a link
    return Path(tempfile.gettempdir()) / f"rig{re.sub(r'[^a-z0-9.]+', '-', named.lower())}.lock"


class Ownership:
    """The right to talk to a port, held from ``take`` to ``release``."""

    def __init__(self, port: str) -> None:
        self.port = port
        self.path = _lock_path(port)
        self._file: int | None = None

    def take(self) -> None:
        """Take the port.

        Raises
        ------
        OwnedError
            If somebody has it; the message says who.
        """
        try:
            file = os.open(self.path, os.O_RDWR)
        except FileNotFoundError:
            file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            owner = os.pread(file, 500, 0).decode("utf-8", "replace").strip() or "another program"
            os.close(file)
            raise OwnedError(
                f"{self.port}: owned by {owner}; wanted a free port. End that program ({self.path})."
            ) from error
        holder = {
            "pid": os.getpid(),
            "host": socket.gethostname(),
            "since": datetime.now(UTC).isoformat(timespec="seconds"),
        }
        os.ftruncate(file, 0)
        os.pwrite(file, json.dumps(holder).encode(), 0)
        self._file = file

    def release(self) -> None:
        """Give the port back; safe to call twice."""
        if self._file is not None:
            os.ftruncate(self._file, 0)
            os.close(self._file)
            self._file = None
