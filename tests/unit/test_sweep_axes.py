"""How the values of a sweep are written and combined."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from imclab.errors import InputError
from imclab.sweep import Axis, combine, parse_axis, parse_distances


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a.b=0.42 1/m,1.42 1/m", ("0.42 1/m", "1.42 1/m")),
        ("a=1, 2", (1, 2)),
        ("a=0.5", (0.5,)),
        ("a=jerlov-II,jerlov-III", ("jerlov-II", "jerlov-III")),
        ('a="x, y",z', ("x, y", "z")),
        ('a=["0 m", "0 m", "0 m"],["20 cm", "0 m", "0 m"]', (["0 m"] * 3, ["20 cm", "0 m", "0 m"])),
        ('a={kind = "lambertian", reflectance = 0.5}', ({"kind": "lambertian", "reflectance": 0.5},)),
        ("a=3 ns,none", ("3 ns", None)),
        ("a=1 to 4 in 4", (1, 2, 3, 4)),
        ("a=0.42 to 1.42 1/m in 3", ("0.42 1/m", "0.92 1/m", "1.42 1/m")),
        ("a=0.42 1/m to 1.42 1/m in 3", ("0.42 1/m", "0.92 1/m", "1.42 1/m")),
        ("a=0.1 1/m to 10 1/m in 3 log", ("0.1 1/m", "1 1/m", "10 1/m")),
        ("a=5 ns,1 ns to 3 ns in 2", ("5 ns", "1 ns", "3 ns")),
        ("a=1 to 0 in 3", (1, 0.5, 0)),
    ],
)
def test_reads_lists_and_ranges(text: str, values: tuple[object, ...]) -> None:
    assert parse_axis(text).values == values


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("medium.attenuation", "no KEY=VALUES"),
        ("=1", "no KEY=VALUES"),
        ("a=", "no value"),
        ("a=1 m to 2 cm in 3", "one unit"),
        ("a=1 to 2 in 1", "2 to"),
        ("a=0 to 2 in 3 log", "above zero"),
        ("a=0.1 1/m to 2 1/m", "START to STOP in COUNT"),
        ("a=0.1 1/m to 2 1/m in 3 lin", "START to STOP in COUNT"),
    ],
)
def test_tells_what_is_wrong_with_the_values(text: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        parse_axis(text)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.integers(2, 50))
def test_a_range_has_both_ends(start: float, stop: float, count: int) -> None:
    values = parse_axis(f"a={start!r} to {stop!r} in {count}").values
    assert len(values) == count
    assert values[0] == pytest.approx(start, rel=1e-11)
    assert values[-1] == pytest.approx(stop, rel=1e-11)


def test_grid_takes_all_combinations_and_zip_the_lists_side_by_side() -> None:
    axes = [Axis("a", (1, 2)), Axis("b", (3, 4))]
    assert combine(axes) == [{"a": 1, "b": 3}, {"a": 1, "b": 4}, {"a": 2, "b": 3}, {"a": 2, "b": 4}]
    assert combine(axes, zipped=True) == [{"a": 1, "b": 3}, {"a": 2, "b": 4}]
    assert combine([]) == combine([], zipped=True) == [{}]


def test_a_list_of_one_value_goes_with_all_that_are_zipped() -> None:
    axes = [Axis("a", (1,)), Axis("b", (3, 4))]
    assert combine(axes, zipped=True) == [{"a": 1, "b": 3}, {"a": 1, "b": 4}]


def test_refuses_a_key_twice_and_lists_that_cannot_be_zipped() -> None:
    with pytest.raises(InputError, match="twice"):
        combine([Axis("a", (1,)), Axis("a", (2,))])
    with pytest.raises(InputError, match="lengths a 2, b 3"):
        combine([Axis("a", (1, 2)), Axis("b", (3, 4, 5))], zipped=True)


def test_distances_have_units() -> None:
    assert parse_distances("1 m, 50 cm") == (1.0, 0.5)
    assert parse_distances(None) == ()
    with pytest.raises(InputError, match="unit"):
        parse_distances("1 m, 5")
