"""Quantities as text at the door, SI floats inside: ``parse("4.5 ns", "time")`` is ``4.5e-09``."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from functools import lru_cache
from typing import Any

# What each kind of quantity is inside, and an example to show in an error.
SI_UNIT = {
    "length": ("m", "5 cm"),
    "time": ("s", "4.5 ns"),
    "attenuation": ("1/m", "0.42 1/m"),
    "angle": ("rad", "200 mrad"),
    "energy": ("J", "20 uJ"),
    "frequency": ("1/s", "1 kHz"),
    "temperature": ("K", "20 degC"),
    "density": ("kg/m**3", "2.71 g/cm^3"),
    "number_density": ("1/m**3", "1e12 1/m^3"),
    "salinity": ("g/kg", "35 g/kg"),
}
# The units that nearly every scene is written in, so that reading one need not load a library of
# units (0.7 s). Each is tested against that library, which reads all others.
COMMON = {
    "length": {"m": "1", "cm": "1e-2", "mm": "1e-3", "um": "1e-6", "nm": "1e-9"},
    "time": {"s": "1", "ms": "1e-3", "us": "1e-6", "ns": "1e-9", "ps": "1e-12"},
    "attenuation": {"1/m": "1"},
    "angle": {"rad": "1", "mrad": "1e-3"},
    "energy": {"J": "1", "mJ": "1e-3", "uJ": "1e-6", "nJ": "1e-9"},
}
_NUMBER = r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
_BARE_NUMBER = re.compile(_NUMBER + r"\Z")
_NUMBER_AND_UNIT = re.compile(_NUMBER + r"(\S+)\s*\Z")


class UnitError(ValueError):
    """A text is no quantity of the wanted kind; the message says what came and what was wanted."""


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    # Decimal arithmetic: "4.5 ns" becomes the float nearest to 4.5e-9, not one rounding away.
    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True, non_int_type=Decimal)


def parse(text: str, kind: str) -> float:
    """Return the quantity written in ``text`` in SI units.

    Parameters
    ----------
    text : str
        A number and a unit, such as ``"0.42 1/m"``.
    kind : str
        A key of `SI_UNIT`.

    Raises
    ------
    UnitError
        When ``text`` has no unit, an unknown one, or one of another dimension.
    """
    unit, example = SI_UNIT[kind]
    wanted = f'text with a unit of {kind.replace("_", " ")}, for example "{example}"'
    if not isinstance(text, str) or not text.strip():
        raise UnitError(f"wanted {wanted}")
    if _BARE_NUMBER.match(text):
        raise UnitError(f"wanted {wanted}: the unit is missing")
    simple = _NUMBER_AND_UNIT.match(_plain(text))
    if simple and simple[2] in COMMON.get(kind, {}):
        return _finite(float(Decimal(simple[1]) * Decimal(COMMON[kind][simple[2]])), wanted)
    try:
        quantity = _registry().parse_expression(_plain(text))
        value = float(quantity.to(unit).magnitude)
    except Exception as error:  # pint raises many unrelated kinds, tokenizer errors among them
        raise UnitError(f"wanted {wanted}") from error
    if kind == "angle" and quantity.unitless and str(quantity.units) == "dimensionless":
        raise UnitError(f"wanted {wanted}: the unit is missing")
    return _finite(value, wanted)


def _finite(value: float, wanted: str) -> float:
    if not math.isfinite(value):
        raise UnitError(f"wanted {wanted}, finite")
    return value


def sum_of(first: str, second: str, *, times: float = 1.0) -> str:
    """Return ``first + times * second`` of two quantities as text, in the unit of ``first``.

    Raises
    ------
    UnitError
        When one is no quantity, or their dimensions differ.
    """
    try:
        start = _registry().parse_expression(_plain(first))
        step = _registry().parse_expression(_plain(second))
        total = (start + Decimal(repr(times)) * step).to(start.units)
        return f"{total.magnitude} {total.units:~C}"
    except Exception as error:  # pint raises many unrelated kinds, tokenizer errors among them
        raise UnitError(f'wanted two quantities of one kind, not "{first}" and "{second}"') from error


def _plain(text: str) -> str:
    return text.replace("µ", "u").replace("μ", "u")


def si_unit_of(text: Any) -> str:
    """Return the SI unit that a quantity in words comes to, ``"5 cm"`` to ``"m"``; nothing for the rest."""
    for kind, (unit, _) in SI_UNIT.items():
        try:
            parse(text, kind)
        except UnitError:
            continue
        return unit
    return ""
