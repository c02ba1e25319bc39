"""Numbers as a reader wants them: rounded to their uncertainty, with unit and a true minus sign."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

_PREFIXES = {-18: "a", -15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k"}
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_THIN = "\u202f"  # narrow no-break space

STYLES = ("plain", "compact", "bare", "signed", "percent", "signed percent", "share", "probability", "count")


def worded(quantity: Mapping[str, Any], style: str = "plain") -> str:
    """Write a quantity of `report.json` as text.

    Parameters
    ----------
    quantity : mapping
        ``value``, ``unit``, perhaps ``stderr`` and ``flag``.
    style : str
        One of `STYLES`. A percentage is the value times 100; a signed one always shows its sign; a
        share is a whole percentage; a bare number stands under a heading with its unit; a compact one
        has its uncertainty in units of the last place: 0.871(12).
    """
    value, stderr, unit = quantity["value"], quantity.get("stderr"), quantity["unit"]
    if value is None:
        return "∞" if quantity.get("flag") == "infinite" else "–"
    if style == "probability":
        return _probability(value)
    if style == "count" or isinstance(value, int):
        return _grouped(value) if abs(value) < 1e5 else _minus(_scientific(value, ""))
    if style == "share":
        return f"<{_THIN}1{_THIN}%" if 0 < value < 0.005 else f"{100 * value:.0f}{_THIN}%"
    sign = "+" if style.startswith("signed") else ""
    if style.endswith("percent"):
        return f"{_rounded(100 * value, _times(stderr, 100), sign)}{_THIN}%"
    if style == "compact" and stderr and 1e-8 < stderr < 1 and abs(value) < 1e6:
        places = 1 - math.floor(math.log10(stderr))
        return _minus(f"{value:.{places}f}({stderr * 10**places:.0f})")
    if unit in ("J", "s") and value:
        exponent = min(max(3 * math.floor(math.log10(abs(value)) / 3), -18), 3)
        factor = 10.0**-exponent
        return f"{_rounded(value * factor, _times(stderr, factor), sign)}{_THIN}{_PREFIXES[exponent]}{unit}"
    text = _rounded(value, stderr, sign)
    return text if unit == "1" or style in ("bare", "compact") else f"{text}{_THIN}{unit}"


def _times(stderr: float | None, factor: float) -> float | None:
    return None if stderr is None else stderr * factor


def _rounded(value: float, stderr: float | None, sign: str) -> str:
    """Two digits of the uncertainty and the value to the same place; without one, three digits."""
    if stderr is None or stderr <= 0 or not math.isfinite(stderr):
        return _minus(_three_digits(value, sign))
    places = 1 - math.floor(math.log10(stderr))
    if places > 8 or abs(value) >= 1e6:
        return _minus(f"{_scientific(value, sign)} ± {_scientific(stderr, '')}")
    places = max(places, 0)
    return _minus(f"{value:{sign}.{places}f} ± {stderr:.{places}f}")


def _three_digits(value: float, sign: str) -> str:
    size = abs(value)
    if value != 0 and not 1e-3 <= size < 1e5:
        return _scientific(value, sign)
    return f"{value:{sign}.3g}" if size < 1000 else f"{value:{sign},.0f}".replace(",", _THIN)


def _scientific(value: float, sign: str) -> str:
    mantissa, exponent = f"{value:{sign}.2e}".split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(_SUPERSCRIPT)}"


def _probability(value: float) -> str:
    if value < 0.001:
        return f"<{_THIN}0.001"
    return f">{_THIN}0.999" if value > 0.999 else f"{value:.3f}"


def _grouped(value: float) -> str:
    return f"{value:,.0f}".replace(",", _THIN)


def _minus(text: str) -> str:
    return text.replace("-", "\N{MINUS SIGN}")
