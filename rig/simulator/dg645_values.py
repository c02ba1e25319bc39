"""The values of a simulated DG645: their ranges, steps, texts and defaults (manual p. 37, 52-57)."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation

STEP_PS = 5
LONGEST_PS = 1_999_999_999_999_995
_PS = Decimal(10) ** 12


class Refusal(Exception):  # noqa: N818 - not an error of the program
    """The device refuses a command with a code of its error queue."""

    def __init__(self, code: int) -> None:
        self.code = code


@dataclass
class Settings:
    """What *SAV stores and *RST resets."""

    delays: list[tuple[int, int]] = field(
        default_factory=lambda: [
            (0, 0),
            (0, 0),
            *((0, 0) if edge % 2 == 0 else (edge - 1, 10_000) for edge in range(2, 10)),
        ]
    )  # (reference edge, ps after it)
    amplitude: list[int] = field(default_factory=lambda: [2500] * 5)  # mV
    offset: list[int] = field(default_factory=lambda: [0] * 5)
    polarity: list[int] = field(default_factory=lambda: [1] * 5)
    prescale: list[int] = field(default_factory=lambda: [1] * 5)
    phase: list[int] = field(default_factory=lambda: [0] * 5)
    numbers: dict[str, int] = field(
        default_factory=lambda: {
            "TSRC": 5, "TRAT": 1_000_000_000, "TLVL": 1000, "ADVT": 0, "HOLD": 0, "INHB": 1, "BURM": 0,
            "BURC": 5, "BURP": 100_000_000, "BURD": 0, "BURT": 0, "SHDP": 1,
        }
    )  # fmt: skip
    steps: dict[str, Decimal] = field(default_factory=dict)
    display: tuple[int, int] = (11, 2)


@dataclass(frozen=True)
class Number:
    """One numeric setting: the unit's scale, its step and ends, and the decimals of its reply."""

    scale: Decimal
    step: int
    lowest: int
    highest: int
    decimals: int

    def read(self, text: str, out_of_range: int = 10) -> int:
        """Return the nearest step of a number, or refuse it; ``out_of_range`` is the code for that."""
        try:
            value = Decimal(text)
        except InvalidOperation:
            raise Refusal(118) from None
        if not value.is_finite():
            raise Refusal(118)
        units = value * self.scale
        if not self.lowest <= units <= self.highest:
            raise Refusal(out_of_range)
        return int((units / self.step).to_integral_value()) * self.step

    def write(self, value: int) -> str:
        """Return the reply's text."""
        text = f"{Decimal(value) / self.scale:.{self.decimals}f}"
        return text if self.decimals == 0 or text.startswith("-") else f"+{text}"


def whole(lowest: int, highest: int) -> Number:
    """Return whole numbers between two ends."""
    return Number(Decimal(1), 1, lowest, highest, 0)


TIME = Number(_PS, STEP_PS, 0, LONGEST_PS, 12)
ANY_DELAY = Number(_PS, STEP_PS, -LONGEST_PS, LONGEST_PS, 12)
_CHOICES = {"TSRC": 6, "ADVT": 1, "INHB": 5, "BURM": 1, "BURT": 1, "SHDP": 1}
NUMBERS = {
    "TRAT": Number(Decimal(10) ** 6, 1, 100, 10**13, 6),
    "TLVL": Number(Decimal(1000), 10, -3500, 3500, 2),
    "HOLD": TIME,
    "BURC": whole(1, 2**32 - 1),
    "BURP": Number(_PS, 10_000, 100_000, 1_999_999_999_990_000, 12),
    "BURD": TIME,
    **{name: whole(0, most) for name, most in _CHOICES.items()},
}
LEVELS = {
    "LAMP": ("amplitude", Number(Decimal(1000), 10, 500, 5000, 2)),
    "LOFF": ("offset", Number(Decimal(1000), 10, -2000, 2000, 2)),
    "LPOL": ("polarity", whole(0, 1)),
}


def check_count(arguments: list[str], wanted: int) -> None:
    """Refuse too few or too many parameters."""
    if len(arguments) != wanted:
        raise Refusal(116 if len(arguments) < wanted else 115)


def index(text: str, highest: int) -> int:
    """Return a whole number from zero to ``highest``, or refuse it."""
    if not re.fullmatch(r"[+-]?\d+", text):
        raise Refusal(120)
    if not 0 <= int(text) <= highest:
        raise Refusal(10)
    return int(text)


STEPPED = {
    "HD": "HOLD", "PH": "PHAS", "PS": "PRES", "TL": "TLVL", "TR": "TRAT", "BC": "BURC", "BD": "BURD",
    "BP": "BURP", "DL": "DLAY", "LA": "LAMP", "LO": "LOFF",
}  # fmt: skip
"""What SSxx and SPxx step, by their last two letters."""
