"""``camera.toml``: what is known of the camera beside the frames."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from calibration.errors import Fault, nearest

PLANCK = 6.62607015e-34
LIGHT_SPEED = 299792458.0
_METRES_OF = {"nm": 1e-9, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "mm": 1e-3, "m": 1.0}


@dataclass(frozen=True)
class Setup:
    """What ``camera.toml`` says; everything but ``bit_depth`` may be left out.

    Attributes
    ----------
    bit_depth : int
        Bits of the camera's digitiser, 8 to 16.
    wavelength : float, optional
        Wavelength of the calibration light, m (written as text with its unit: "532 nm").
    name : str
        The camera's name, for the report.
    intensified : bool
        Whether an image intensifier stands before the sensor (default) or the sensor is bare.
    reference_gain : float, optional
        The gain setting that the relative gain is 1 at; default: the one with most light levels.
    gain_unit : str
        Unit of the gain setting, for the report ("V").
    saturation_counts : float, optional
        Raw counts from which a pixel is saturated; default: full scale, or where counts pile up.
    energy_stderr : float, optional
        Relative standard uncertainty of each light level by itself (a hundredth: 0.01).
    energy_scale_stderr : float
        Relative standard uncertainty common to all levels (of the photodiode, of the pixel area).
    excess_noise, excess_noise_stderr : float
        The intensifier's excess noise factor squared (F², at least 1) from elsewhere, if known.
    known_gain : mapping
        Relative gains that are known beforehand, setting -> gain (table ``[known_gain]``).
    known_gain_stderr : float
        Relative standard uncertainty of each known gain.
    """

    bit_depth: int
    wavelength: float | None = None
    name: str = ""
    intensified: bool = True
    reference_gain: float | None = None
    gain_unit: str = ""
    saturation_counts: float | None = None
    energy_stderr: float | None = None
    energy_scale_stderr: float = 0.0
    excess_noise: float | None = None
    excess_noise_stderr: float = 0.0
    known_gain: Mapping[float, float] = field(default_factory=dict)
    known_gain_stderr: float = 1e-3

    @property
    def full_scale(self) -> int:
        """The largest count of the digitiser."""
        return int(2**self.bit_depth) - 1

    @property
    def photon_energy(self) -> float:
        """Energy of one photon, J; NaN when the wavelength is not known."""
        return math.nan if self.wavelength is None else PLANCK * LIGHT_SPEED / self.wavelength


def read_setup(path: Path) -> tuple[Setup | None, list[Fault]]:
    """Read ``camera.toml``; give the setup, or None with all that is wrong."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None, [Fault(path.name, "no such file", "a file with at least `bit_depth = 12`")]
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        return None, [Fault(path.name, f"text that is not TOML ({error})", "lines like `bit_depth = 12`")]
    known = [item.name for item in fields(Setup)]
    faults = [
        Fault(f"{path.name}: {key}", "an unknown key", "a key of the camera's setup", nearest(key, known))
        for key in data
        if key not in known
    ]
    if "bit_depth" not in data:
        faults.append(Fault(f"{path.name}: bit_depth", "nothing", "a whole number from 8 to 16"))
    values: dict[str, Any] = {}
    for key in known:
        if key in data:
            try:
                values[key] = _CHECK[key](data[key])
            except _WantedError as wanted:
                faults.append(Fault(f"{path.name}: {key}", repr(data[key]), str(wanted)))
    return (Setup(**values), []) if not faults else (None, faults)


class _WantedError(Exception):
    """What a value of the setup should have been."""


def _number(low: float, high: float, wanted: str) -> Any:
    def check(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise _WantedError(wanted)
        return float(value)

    return check


def _bit_depth(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 8 <= value <= 16:
        raise _WantedError("a whole number from 8 to 16")
    return value


def _wavelength(value: Any) -> float:
    match = (
        re.fullmatch(r"\s*([0-9.eE+-]+)\s*(nm|um|µm|μm|mm|m)\s*", value) if isinstance(value, str) else None
    )
    try:
        length = float(match[1]) * _METRES_OF[match[2]] if match else math.nan
    except ValueError:
        length = math.nan
    if not 1e-9 < length < 1e-3:
        raise _WantedError('a length with its unit, like "532 nm"')
    return length


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise _WantedError("a text in quotes")
    return value


def _truth(value: Any) -> bool:
    if not isinstance(value, bool):
        raise _WantedError("true or false")
    return value


def _gain_table(value: Any) -> Mapping[float, float]:
    wanted = "a table of setting = relative gain, both numbers, the gain above 0"
    try:
        table = {float(key): float(gain) for key, gain in dict(value).items()}
    except (TypeError, ValueError):
        raise _WantedError(wanted) from None
    if not all(math.isfinite(key) and 0.0 < gain < math.inf for key, gain in table.items()):
        raise _WantedError(wanted)
    return table


_FRACTION = _number(0.0, 1.0, "a fraction between 0 and 1 (one hundredth is 0.01)")
_CHECK: dict[str, Any] = {
    "bit_depth": _bit_depth,
    "wavelength": _wavelength,
    "name": _text,
    "intensified": _truth,
    "reference_gain": _number(-math.inf, math.inf, "a gain setting (a number)"),
    "gain_unit": _text,
    "saturation_counts": _number(1.0, 65535.0, "raw counts above 0"),
    "energy_stderr": _FRACTION,
    "energy_scale_stderr": _FRACTION,
    "excess_noise": _number(1.0, 100.0, "a number of at least 1 (the excess noise factor squared)"),
    "excess_noise_stderr": _number(0.0, 100.0, "a number of at least 0"),
    "known_gain": _gain_table,
    "known_gain_stderr": _FRACTION,
}
