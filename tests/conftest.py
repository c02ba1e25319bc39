"""What every test can rely on."""

from __future__ import annotations

import signal


def pytest_configure() -> None:
    """Hear interrupts, so that the commands which tests start and interrupt hear them too.

    A shell starts what runs in its background with SIGINT ignored, and children inherit that.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
