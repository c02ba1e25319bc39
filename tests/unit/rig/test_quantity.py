"""Decimal text with units, digit for digit."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.errors import PlanError
from rig.quantity import decimal_text, engineering_time, exact, nearest, picoseconds


@pytest.mark.parametrize(
    ("text", "ps"),
    [
        ("85 ns", 85_000),
        ("85ns", 85_000),
        ("445.320 ns", 445_320),
        ("1999.999999999995 s", 1_999_999_999_999_995),
        ("2.5 us", 2_500_000),
        ("2.5 µs", 2_500_000),
        ("1e-9 s", 1000),
        (".5 ns", 500),
        ("0", 0),
        (1e-8, 10_000),
        (4.4532e-07, 445_320),
        (Decimal("85e-9"), 85_000),
        ("-120.4 ns", -120_400),
    ],
)
def test_times_become_whole_picoseconds(text: str, ps: int) -> None:
    assert picoseconds(text) == ps


@given(st.integers(0, 1_999_999_999_999_995))
def test_no_digit_is_lost_on_the_way_out_and_back(ps: int) -> None:
    assert picoseconds(f"{decimal_text(Fraction(ps, 10**12), 12)} s") == ps


def test_binary_floats_would_lose_them() -> None:
    """Power: the same round trip through seven decimals, as other drivers have it, fails."""
    assert picoseconds(f"{445_320e-12:.7f} s") != 445_320


@pytest.mark.parametrize(
    "text", ["nan", "inf ns", "85", "85 kg", "eighty ns", "1e999 s", "", "1 2 ns", "0x10 ns"]
)
def test_what_is_no_time_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(PlanError, match="85 ns"):
        exact(text, "time")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), None, True, [1]])
def test_what_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(PlanError):
        exact(value, "time")  # type: ignore[arg-type]


def test_a_wrong_unit_is_told_with_the_nearest() -> None:
    with pytest.raises(PlanError, match="Did you mean 'ns'"):
        exact("85 nS", "time")


def test_halves_go_to_the_even_step() -> None:
    assert [nearest(Fraction(5 * n, 2), 5) for n in range(1, 6)] == [0, 1, 2, 2, 2]


@pytest.mark.parametrize(
    ("ps", "text"),
    [(363_445, "363.445 ns"), (5, "5 ps"), (10**7, "10 us"), (-75_947, "-75.947 ns"), (0, "0 ps")],
)
def test_times_for_people(ps: int, text: str) -> None:
    assert engineering_time(ps) == text
