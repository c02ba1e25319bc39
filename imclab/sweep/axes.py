"""Which keys of a scene take which values: lists and ranges as text, combined by grid or by zip."""

from __future__ import annotations

import itertools
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from imclab import units
from imclab.errors import Fault, InputError

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(
    rf"(?P<start>{_NUMBER})\s*(?P<unit_of_start>\D*?|\D.*?)\s+to\s+(?P<stop>{_NUMBER})\s*(?P<unit>\D.*?|)"
    r"\s+in\s+(?P<count>\d+)(?P<log>\s+log)?"
)
_HALF_RANGE = re.compile(rf"{_NUMBER}.*\s+to\s+{_NUMBER}.*")
_RANGE_WANTED = (
    'START to STOP in COUNT, for example "0.1 1/m to 10 1/m in 8", or "... in 8 log" for equal ratios'
)
_VALUES_WANTED = (
    'KEY=VALUES, values separated by commas or a range, for example medium.attenuation="0.42 1/m,1.42 1/m" '
    'or medium.attenuation="0.1 1/m to 10 1/m in 8 log"'
)
MOST_VALUES = 100_000
"""A range longer than this is taken for a slip of the finger."""


@dataclass(frozen=True)
class Axis:
    """A dotted key of the scene and the values it takes; ``None`` leaves the key out."""

    key: str
    values: tuple[Any, ...]


def parse_axis(text: str) -> Axis:
    """Read ``KEY=VALUES`` as the command line gives it.

    Values are separated by commas. One may be a number, text with a unit, any TOML value (quoted
    text, a list, an inline table), the word ``none`` (the key is left out), or a range
    ``START to STOP in COUNT`` with both ends included, ``log`` behind it for equal ratios.

    Raises
    ------
    InputError
        When there is no key, no value, or a range that makes no sense.
    """
    key, equals, values = text.partition("=")
    key = key.strip()
    if not equals or not re.fullmatch(r"\w+(\.\w+)*", key):
        raise InputError("--set", [Fault(f'"{text}"', "no KEY=VALUES", _VALUES_WANTED)])
    items = [item for part in _split(values) for item in _read(part.strip(), key)]
    if not items:
        raise InputError("--set", [Fault(key, "no value", _VALUES_WANTED)])
    return Axis(key, tuple(items))


def parse_distances(text: str | None) -> tuple[float, ...]:
    """Read planes as ``"1 m, 5 m"`` or ``"1 m to 30 m in 10"``; nothing gives none.

    Raises
    ------
    InputError
        With every distance that is none.
    """
    faults, distances = [], []
    for value in parse_axis(f"distances={text}").values if text else ():
        try:
            distances.append(units.parse(value, "length"))
        except units.UnitError as error:
            faults.append(Fault("--distances", f'"{value}"', str(error).removeprefix("wanted ")))
    if faults:
        raise InputError("--distances", faults)
    return tuple(distances)


def combine(axes: Sequence[Axis], *, zipped: bool = False) -> list[dict[str, Any]]:
    """Return the changes of each scene, the last axis running fastest.

    Parameters
    ----------
    axes : sequence of Axis
    zipped : bool
        Take first values together, second values together, and so on, instead of all combinations;
        a list of one value goes with all.

    Raises
    ------
    InputError
        A key named twice, or lists of different lengths that were to be zipped.
    """
    keys = [axis.key for axis in axes]
    twice = sorted({key for key in keys if keys.count(key) > 1})
    if twice:
        raise InputError("--set", [Fault(key, "the key twice", "each key once") for key in twice])
    if not zipped:
        return [dict(zip(keys, point, strict=True)) for point in itertools.product(*(a.values for a in axes))]
    count = max((len(axis.values) for axis in axes), default=1)
    if any(len(axis.values) not in (1, count) for axis in axes):
        lengths = ", ".join(f"{axis.key} {len(axis.values)}" for axis in axes)
        wanted = "lists of one length, or of one value"
        raise InputError("--zip", [Fault("--set", f"lists of lengths {lengths}", wanted)])
    lists = [axis.values * (count // len(axis.values)) for axis in axes]
    return [dict(zip(keys, point, strict=True)) for point in zip(*lists, strict=True)] or [{}]


def _split(text: str) -> list[str]:
    """Split at commas that stand outside brackets, braces and quotes."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in "[{":
            depth += 1
        elif letter in "]}":
            depth -= 1
        if letter == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return [part for part in parts if part.strip()]


def _read(item: str, key: str) -> list[Any]:
    if item == "none":
        return [None]
    found = _RANGE.fullmatch(item)
    if found:
        return _range(found, key)
    if _HALF_RANGE.fullmatch(item):
        raise InputError("--set", [Fault(key, f'"{item}"', _RANGE_WANTED)])
    try:
        return [tomllib.loads(f"value = {item}")["value"]]
    except tomllib.TOMLDecodeError:
        return [item]


def _range(found: re.Match[str], key: str) -> list[Any]:
    start, stop, count = float(found["start"]), float(found["stop"]), int(found["count"])
    unit, log = found["unit"].strip(), found["log"] is not None
    faults = []
    if found["unit_of_start"].strip() not in ("", unit):
        faults.append(Fault(key, f'a range from "{found["unit_of_start"]}" to "{unit}"', "one unit"))
    if not 2 <= count <= MOST_VALUES:
        faults.append(Fault(key, f"a range in {count} values", f"2 to {MOST_VALUES} values"))
    if log and not (start > 0 and stop > 0):
        faults.append(Fault(key, f"a log range from {start:g} to {stop:g}", "both ends above zero"))
    if faults:
        raise InputError("--set", faults)
    numbers = np.geomspace(start, stop, count) if log else np.linspace(start, stop, count)
    # Twelve digits: what a person would have typed, without the dust of binary fractions.
    texts = [f"{number:.12g}" for number in numbers]
    return [f"{text} {unit}" if unit else _plain_number(text) for text in texts]


def _plain_number(text: str) -> float | int:
    value = float(text)
    return int(value) if value.is_integer() else value
