"""Transport of light through the scene: pictures with `simulate`, one way with `transmit`.

numba lives here alone, and is loaded when a simulation is asked for, not before.
"""

from __future__ import annotations

from imclab.transport.simulation import simulate
from imclab.transport.transmission import transmit

__all__ = ["simulate", "transmit"]
