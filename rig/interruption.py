"""Signals as exceptions: SIGTERM and SIGHUP end a session the way Ctrl-C does, through its cleaning up."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def _raise(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt(f"signal {signal.Signals(number).name}")


@contextlib.contextmanager
def _handled(handler: signal.Handlers | signal._HANDLER) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield  # Python delivers signals to the main thread only
        return
    before = {number: signal.signal(number, handler) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, signal.SIG_DFL if old is None else old)


def interruptible() -> contextlib.AbstractContextManager[None]:
    """Turn SIGINT, SIGTERM and SIGHUP into ``KeyboardInterrupt`` within the block."""
    return _handled(_raise)


def undisturbed() -> contextlib.AbstractContextManager[None]:
    """Ignore them within the block: while a box is made safe nothing may cut in."""
    return _handled(signal.SIG_IGN)
