"""Quantities as text."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from imclab import units


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("4.5 ns", "time", 4.5e-9),
        ("0.42 1/m", "attenuation", 0.42),
        ("0.42/m", "attenuation", 0.42),
        ("200 mrad", "angle", 0.2),
        ("180 deg", "angle", math.pi),
        ("20 uJ", "energy", 2e-5),
        ("20 µJ", "energy", 2e-5),
        ("20 degC", "temperature", 293.15),
        ("2.71 g/cm^3", "density", 2710.0),
        ("5 mg/L", "density", 0.005),
        ("1 kHz", "frequency", 1000.0),
        ("-1 m", "length", -1.0),
    ],
)
def test_reads_quantities_exactly(text: str, kind: str, value: float) -> None:
    assert units.parse(text, kind) == value


@pytest.mark.parametrize(
    ("text", "kind", "says"),
    [
        ("5 kg", "length", "unit of length"),
        ("5", "length", "the unit is missing"),
        ("0.2", "angle", "the unit is missing"),
        ("5 blah", "length", "5 cm"),
        ("inf m", "length", "finite"),
        ("", "time", "4.5 ns"),
        ("__import__('os')", "length", "5 cm"),
    ],
)
def test_refuses_what_is_no_such_quantity(text: str, kind: str, says: str) -> None:
    with pytest.raises(units.UnitError, match=says):
        units.parse(text, kind)


@given(st.decimals(min_value=0, max_value=10**6, places=6, allow_nan=False))
def test_decimal_text_becomes_the_nearest_float(number: object) -> None:
    assert units.parse(f"{number} ns", "time") == float(f"{number}e-9")


COMMON = [(kind, unit) for kind, known in units.COMMON.items() for unit in known]


@pytest.mark.parametrize(("kind", "unit"), COMMON)
def test_common_units_are_those_of_the_library_of_units(kind: str, unit: str) -> None:
    import pint

    wanted = pint.UnitRegistry().parse_expression(f"4.25 {unit}").to(units.SI_UNIT[kind][0]).magnitude
    assert units.parse(f"4.25 {unit}", kind) == pytest.approx(wanted, rel=1e-15)


def test_a_common_scene_is_read_without_the_library_of_units() -> None:
    root = Path(__file__).parents[2]
    code = "import sys, imclab; imclab.load_scene('data/scenes/tank.toml'); print('pint' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=root, check=True)
    assert done.stdout.split() == ["False"]
