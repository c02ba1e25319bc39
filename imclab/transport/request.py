"""What a caller asks of a run, checked: when to stop, and the seed."""

from __future__ import annotations

import math

from imclab.errors import Fault, InputError
from imclab.scene import Scene
from imclab.transport.runner import Until

DEFAULT_REL_ERROR = 0.01
_LARGEST_SEED = 2**63 - 1


def limits(
    scene: Scene,
    *,
    rel_error: float | None,
    seconds: float | None,
    packets: float | None,
    pixel_error: float | None = None,
) -> Until:
    """Return when to stop: as asked, else as the scene says, else at 1 % relative error.

    ``pixel_error`` takes the place of ``rel_error``: the error that stops the run is then that of pixels.
    """
    if pixel_error is not None and rel_error is not None:
        wanted = "only one: the total's error or the median pixel's"
        raise InputError("run", [Fault("pixel_error", f"{pixel_error} beside rel_error {rel_error}", wanted)])
    error_name = "rel_error" if pixel_error is None else "pixel_error"
    error = rel_error if pixel_error is None else pixel_error
    asked = {error_name: error, "seconds": seconds, "packets": packets}
    if all(value is None for value in asked.values()):  # then it is rel_error that was not asked for
        asked = {name: getattr(scene.run, name) for name in asked}
    if all(value is None for value in asked.values()):
        asked["rel_error"] = DEFAULT_REL_ERROR
    faults = [
        Fault(name, f"{value}", "a finite number above 0")
        for name, value in asked.items()
        if value is not None and not (math.isfinite(value) and value > 0)
    ]
    error = asked[error_name]
    if error is not None and not faults and error >= 1:
        faults.append(Fault(error_name, f"{error}", "a number above 0 and below 1: 0.02 is 2 %"))
    if asked["packets"] is not None and not faults and asked["packets"] < 1:
        faults.append(Fault("packets", f"{asked['packets']}", "at least 1"))
    if faults:
        raise InputError("run", faults)
    count = None if asked["packets"] is None else round(asked["packets"])
    return Until(error, asked["seconds"], count)


def seed_of(scene: Scene, seed: int | None) -> int:
    """Return the seed asked for, else the scene's."""
    used = scene.run.seed if seed is None else seed
    if not 0 <= used <= _LARGEST_SEED:
        raise InputError("run", [Fault("seed", f"{seed}", "0 to 2^63 - 1")])
    return used


def check_threads(threads: int | None) -> None:
    """Refuse a number of threads that is no positive count."""
    if threads is not None and threads < 1:
        raise InputError("run", [Fault("threads", f"{threads}", "at least 1, or none for all")])
