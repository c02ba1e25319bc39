"""What every command shares: JSON on stdout, words for people, progress on stderr."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping
from typing import Any

import typer

JSON_OPTION = typer.Option("--json", help="Print one JSON object on stdout instead of words.")


def jsonable(value: Any) -> Any:
    """Turn numbers, arrays and mappings into what JSON can hold; what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): jsonable(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return jsonable(value.tolist())
    if isinstance(value, (list, tuple)):
        return [jsonable(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def emit(data: Mapping[str, Any], text: str, *, as_json: bool) -> None:
    """Print ``data`` as one JSON object, or ``text``, on stdout."""
    print(json.dumps(jsonable(data), indent=2) if as_json else text)


PREPARING = "preparing (the first run of a version compiles its kernels: some 15 s)"


def told(reached: Any, *, of: str = "the result", goal: float | None = None) -> str:
    """Put into words what a run's progress callback is told (`imclab.transport.runner.Reached`).

    With the relative error that is wanted, ``goal``, also how long that will take: errors fall with the
    root of time.
    """
    known = math.isfinite(reached.rel_error)
    error = f"{100.0 * reached.rel_error:.3g} %" if known else "not known yet"
    words = f"relative error of {of} {error} after {reached.packets:.3g} packets and {reached.seconds:.1f} s"
    if goal is None or not known or reached.rel_error <= goal:
        return words
    left = reached.seconds * ((reached.rel_error / goal) ** 2 - 1.0)
    return f"{words}; about {left:.2g} s more to {100.0 * goal:.3g} %"


class Progress:
    """A line on stderr that is rewritten on a terminal and appended to a log.

    Call it with a text; nothing is drawn more often than ten times a second on a terminal, and
    once in five seconds elsewhere.
    """

    def __init__(self, *, quiet: bool = False) -> None:
        import time

        self._clock = time.monotonic
        self._terminal = sys.stderr.isatty()
        self._interval = 0.1 if self._terminal else 5.0
        self._last = -math.inf
        self._quiet = quiet
        self._open = False

    def __call__(self, text: str, *, final: bool = False) -> None:
        """Show ``text``; ``final`` always draws it and ends the line."""
        now = self._clock()
        if self._quiet or (not final and now - self._last < self._interval):
            return
        self._last = now
        if self._terminal:
            end = "\n" if final else ""
            print(f"\r\x1b[2K{text}", end=end, file=sys.stderr, flush=True)
            self._open = not final
        else:
            print(text, file=sys.stderr, flush=True)

    def close(self) -> None:
        """End a line left open, so that what follows starts on its own."""
        if self._open:
            print(file=sys.stderr, flush=True)
            self._open = False
