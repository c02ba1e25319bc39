"""What happens to light that reaches the aperture: its pixel, its share of the gate, its time bin."""

from __future__ import annotations

import math
from typing import Any

from imclab.transport.kernel_cache import device

_ROOT_HALF = math.sqrt(0.5)


@device
def pixel_of(setup: Any, point: Any, direction: Any) -> Any:
    """Return (row, column) of a ray that arrives at a point of the receiver's plane; (-1, -1) outside.

    The lens is ideal and focused on the target: the ray traced straight back to the object plane says
    where it seems to come from. ``direction`` is that of flight, with a negative z.
    """
    back = (setup.target.distance - setup.receiver.z) / direction[2]
    return pixel_at(setup, point[0] + back * direction[0], point[1] + back * direction[1])


@device
def pixel_at(setup: Any, x: Any, y: Any) -> Any:
    """Return (row, column) of a point of the object plane, (-1, -1) outside the target's rectangle."""
    target, receiver = setup.target, setup.receiver
    across = (x + target.half_width) / (2.0 * target.half_width)
    down = (y + target.half_height) / (2.0 * target.half_height)
    if not (0.0 <= across < 1.0 and 0.0 <= down < 1.0):
        return -1, -1
    return min(int(down * receiver.rows), receiver.rows - 1), min(
        int(across * receiver.columns), receiver.columns - 1
    )


@device
def gate_share(gate: Any, arrival: Any) -> Any:
    """Return the share of a pulse whose peak arrives at ``arrival`` (s) that falls into the open gate.

    The expectation over the emission time: no time is drawn. The difference of two error functions is
    taken on the side where both are small, so that far tails keep their digits.
    """
    if gate.opens == -math.inf:
        return 1.0
    early = (gate.opens - arrival) / gate.sigma * _ROOT_HALF
    late = (gate.closes - arrival) / gate.sigma * _ROOT_HALF
    if early > 0.0:
        return 0.5 * (math.erfc(early) - math.erfc(late))
    return 0.5 * (math.erfc(-late) - math.erfc(-early))


@device
def time_bin(time: Any, arrival: Any) -> Any:
    """Return the time bin of an arrival, -1 outside all."""
    place = (arrival - time.start) / time.width
    return int(place) if 0.0 <= place < time.bins else -1
