"""Decimal text with units into exact numbers: ``"85 ns"``, ``"1 m"``, ``"2.5 V"``.

Gate times never pass through binary floating point: ``10e-9 // 1e-9`` is 9.0. Text becomes a
``Fraction`` of the SI unit, digit for digit; a float is taken as the shortest decimal that prints it.
"""

from __future__ import annotations

import difflib
import re
from decimal import Decimal
from fractions import Fraction

from rig.errors import Fault, PlanError

Quantity = str | int | float | Decimal | Fraction
"""Text with a unit, or a bare number in the SI unit."""

_UNITS: dict[str, dict[str, Fraction]] = {
    "time": {
        unit: Fraction(scale)
        for unit, scale in {
            "s": "1", "ms": "1e-3", "us": "1e-6", "µs": "1e-6", "μs": "1e-6", "ns": "1e-9", "ps": "1e-12",
            "fs": "1e-15", "min": "60",
        }.items()
    },
    "length": {
        unit: Fraction(scale)
        for unit, scale in {"m": "1", "km": "1e3", "cm": "1e-2", "mm": "1e-3", "um": "1e-6", "µm": "1e-6",
                            "nm": "1e-9"}.items()
    },
    "voltage": {"V": Fraction(1), "mV": Fraction("1e-3")},
    "rate": {
        unit: Fraction(scale)
        for unit, scale in {"Hz": "1", "uHz": "1e-6", "mHz": "1e-3", "kHz": "1e3", "MHz": "1e6"}.items()
    },
    "temperature": {"degC": Fraction(1), "°C": Fraction(1), "C": Fraction(1)},
    "delay per length": {"s/m": Fraction(1), "ns/m": Fraction("1e-9"), "ps/m": Fraction("1e-12"),
                         "ps/mm": Fraction("1e-9")},
    "number": {"": Fraction(1)},
}  # fmt: skip
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,2})?)\s*(\S*)\s*")
_EXAMPLE = {
    "time": "85 ns",
    "length": "1.5 m",
    "voltage": "2.5 V",
    "rate": "1 kHz",
    "temperature": "20 degC",
    "delay per length": "5 ns/m",
    "number": "1.357",
}


def _refused(where: str, value: object, kind: str, advice: str = "") -> PlanError:
    wanted = f"a {kind}, such as {_EXAMPLE[kind]!r}"
    return PlanError(where, [Fault(where, repr(value), wanted, advice)])


def exact(value: Quantity, kind: str, *, name: str = "value") -> Fraction:
    """Turn a quantity into an exact number of its SI unit.

    Parameters
    ----------
    value : str, int, float, Decimal or Fraction
        Text with a unit; a bare number (or text without a unit) is in the SI unit.
    kind : str
        ``"time"``, ``"length"``, ``"voltage"``, ``"rate"``, ``"temperature"`` (degrees Celsius),
        ``"delay per length"`` or ``"number"``.
    name : str
        How messages call it.

    Raises
    ------
    PlanError
        If it is no finite number, or its unit is not one of the kind.
    """
    if isinstance(value, bool) or not isinstance(value, (str, int, float, Decimal, Fraction)):
        raise _refused(name, value, kind)
    if isinstance(value, (int, Fraction)):
        return Fraction(value)
    text = repr(value) if isinstance(value, float) else str(value)
    matched = _NUMBER.fullmatch(text)
    if matched is None:
        raise _refused(name, value, kind)
    number, unit = matched.groups()
    if unit == "" and isinstance(value, str) and kind != "number" and Fraction(number) != 0:
        units = ", ".join(_UNITS[kind])
        raise _refused(name, value, kind, f"Text needs its unit: {units}.")
    scale = _UNITS[kind].get(unit, Fraction(1) if unit == "" else None)
    if scale is None:
        near = difflib.get_close_matches(unit, _UNITS[kind], 1, 0.4)
        known = ", ".join(name or "no unit" for name in _UNITS[kind])
        hint = f"Did you mean {near[0]!r}? " if near else ""
        raise _refused(name, value, kind, f"{hint}Known units: {known}.")
    return Fraction(number) * scale


def nearest(value: Fraction, step: int | Fraction = 1) -> int:
    """Round to the nearest multiple of ``step``, halves to the even multiple; return the multiple's count."""
    return round(Fraction(value) / step)


def picoseconds(value: Quantity, *, name: str = "time") -> int:
    """Return a time as whole picoseconds, rounded once, halves to even."""
    return nearest(exact(value, "time", name=name) * 10**12)


def seconds(value: Quantity, *, name: str = "time") -> float:
    """Return a time in seconds, for clocks and pauses."""
    return float(exact(value, "time", name=name))


def decimal_text(value: Fraction, decimals: int) -> str:
    """Write ``value`` in fixed point with exactly ``decimals`` digits, without binary arithmetic."""
    scaled = round(value * 10**decimals)
    sign = "-" if scaled < 0 else ""
    digits = str(abs(scaled)).rjust(decimals + 1, "0")
    return f"{sign}{digits[:-decimals]}.{digits[-decimals:]}" if decimals else f"{sign}{digits}"


def engineering_time(picosecond_count: int | Fraction) -> str:
    """Write a time for people: ``363.445 ns``, ``2.5 us``, all its digits down to 0.1 ps."""
    value = Fraction(picosecond_count)
    for unit, scale in (("s", 10**12), ("ms", 10**9), ("us", 10**6), ("ns", 10**3)):
        if abs(value) >= scale:
            decimals = len(str(scale))
            return f"{decimal_text(value / scale, decimals).rstrip('0').rstrip('.')} {unit}"
    return f"{decimal_text(value, 1).rstrip('0').rstrip('.')} ps"
