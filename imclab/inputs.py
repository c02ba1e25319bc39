"""Scene inputs with an uncertainty: the same scene with one of them moved by its standard uncertainty."""

from __future__ import annotations

from typing import Any

from imclab import units
from imclab.errors import Fault, InputError
from imclab.scene import Scene


def moved_by_its_uncertainty(scene: Scene, dotted: str, spread: str | float) -> Scene:
    """Return ``scene`` with the value at ``dotted`` raised by ``spread``.

    Parameters
    ----------
    dotted : str
        Path of a key that the scene gives, such as ``"medium.attenuation"``.
    spread : str or float
        Standard uncertainty: text with a unit when the value is one, else a number.

    Raises
    ------
    InputError
        When the scene does not give the key, or value and spread are not of one kind.
    """
    value: Any = scene.document
    for key in dotted.split("."):
        value = value.get(key) if isinstance(value, dict) else None
    try:
        moved: str | float
        if isinstance(value, str) and isinstance(spread, str):
            moved = units.sum_of(value, spread)
        elif isinstance(value, (int, float)) and isinstance(spread, (int, float)):
            moved = value + spread
        else:
            raise units.UnitError(f"wanted an uncertainty of the same kind as the scene's value {value!r}")
    except units.UnitError as error:
        fault = Fault(f"uncertainty.{dotted}", repr(spread), str(error).removeprefix("wanted "))
        raise InputError("experiment", [fault]) from None
    return scene.with_(**{dotted: moved})
