"""The journal: every byte block that was sent, written down before it is sent.

One JSON object a line, appended with one ``write`` to a file opened for appending, so that a killed
program leaves whole lines: ``utc``, ``monotonic``, ``kind`` (``open``, ``settings``, ``sent``,
``received``, ``note``, ``close``), and ``text``. The lines of a session replay on the simulated
generator to the settings that the real one holds.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rig.errors import Fault, PlanError


@dataclass(frozen=True)
class Entry:
    """One line of a journal."""

    kind: str
    text: str
    details: dict[str, Any]


class Journal:
    """An append-only record; without a path it keeps nothing but the last lines in memory.

    Parameters
    ----------
    path : path-like, optional
        Where to append.
    """

    def __init__(self, path: str | os.PathLike[str] | None = None) -> None:
        self.path = None if path is None else Path(path)
        self.sent: list[bytes] = []
        self._file: int | None = None

    def open(self) -> None:
        """Open the file for appending."""
        if self.path is not None and self._file is None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)

    def close(self) -> None:
        """Close the file; safe to call twice."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def write(self, kind: str, text: str = "", **details: Any) -> None:
        """Append one line and hand it to the operating system before returning."""
        if self._file is None:
            return
        line = {
            "utc": datetime.now(UTC).isoformat(timespec="milliseconds"),
            "monotonic": round(time.monotonic(), 6),
            "kind": kind,
            "text": text,
            **details,
        }
        os.write(self._file, (json.dumps(line) + "\n").encode())

    def write_sent(self, block: bytes, meaning: str) -> None:
        """Record a block that is about to be sent."""
        self.sent.append(block)
        self.write("sent", block.decode("latin-1"), meaning=meaning)

    def write_received(self, block: bytes) -> None:
        """Record what came back."""
        self.write("received", block.decode("latin-1"))


def read_journal(path: str | os.PathLike[str]) -> Iterator[Entry]:
    """Yield the entries of a journal; a last line cut short by a crash is left out.

    Raises
    ------
    PlanError
        If a line is not one of a journal.
    """
    lines = Path(path).read_text(encoding="utf-8").split("\n")
    for number, line in enumerate(lines, 1):
        if line == "" or number == len(lines):
            continue
        try:
            fields = json.loads(line)
            kind, text = fields.pop("kind"), fields.pop("text")
        except (ValueError, KeyError, AttributeError) as error:
            fault = Fault(f"{path}, line {number}", repr(line[:60]), "one JSON object of a journal")
            raise PlanError("journal", [fault]) from error
        yield Entry(kind, text, fields)
