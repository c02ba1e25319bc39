"""Water, Jerlov's types and metals: the values of the sources, and the ends of their ranges."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from imclab.errors import InputError
from imclab.optics import water
from imclab.optics.metals import metal_index

GREEN = 532e-9
REFERENCE = Path(__file__).parents[2] / "reference"


def test_coefficients_at_532_nm() -> None:
    assert water.absorption(GREEN) == pytest.approx(0.0454, abs=5e-5)
    assert water.absorption(532.5e-9, source="pope-fry") == pytest.approx(0.0447)
    assert water.scattering(GREEN) == pytest.approx(0.00151, abs=5e-6)
    assert water.scattering(GREEN, salinity=35.0) == pytest.approx(0.00196, abs=5e-6)
    assert water.scattering(GREEN, salinity=38.4) > water.scattering(GREEN, salinity=36.0)
    pure = water.pure_water(GREEN)
    assert pure.attenuation == pytest.approx(0.04538 + 0.00151, abs=2e-5)
    assert pure.albedo == pytest.approx(0.0322, abs=1e-4)


def test_absorption_moves_with_temperature_and_salinity_as_the_table_says() -> None:
    warm = water.absorption(600e-9, temperature=303.15)
    assert warm != water.absorption(600e-9)
    assert water.absorption(600e-9, salinity=35.0) != water.absorption(600e-9)
    assert water.absorption([380e-9, 730e-9]).shape == (2,)


def test_indices_are_those_of_quan_and_fry_in_vacuum() -> None:
    lines = (REFERENCE / "seawater_index_quanfry1995.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert len(rows) == 36
    for row in rows:
        conditions = {"temperature": float(row["T_C"]) + 273.15, "salinity": float(row["S_permil"])}
        wavelength = float(row["wavelength_nm"]) * 1e-9
        found = water.refractive_index(wavelength, **conditions)
        assert found == pytest.approx(float(row["n_vacuum"]), abs=2e-9)
        assert water.group_index(wavelength, **conditions) == pytest.approx(
            float(row["group_index"]), abs=2e-9
        )
    # An independent source: IAPWS R9-97 at 20 deg C.
    assert water.refractive_index(GREEN) == pytest.approx(1.335380, abs=5e-5)
    assert water.group_index(GREEN) == pytest.approx(1.356952, abs=5e-6)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: water.absorption(379e-9), "380 to 730 nm"),
        (lambda: water.absorption(728e-9, source="pope-fry"), "380 to 727.5 nm"),
        (lambda: water.absorption(GREEN, temperature=20.0), "temperature: got -253.15; wanted 0 to 40 deg C"),
        (lambda: water.absorption(GREEN, source="mine"), '"wopp" or "pope-fry"'),
        (lambda: water.scattering(GREEN, salinity=50.0), "0 to 38.4 g/kg"),
        (lambda: water.refractive_index(701e-9), "400 to 700 nm"),
        (lambda: water.group_index(GREEN, salinity=41.0), "0 to 40 g/kg"),
        (lambda: water.jerlov("IV", GREEN), "I, IA, IB, II, III"),
        (lambda: water.jerlov("I", GREEN, source="williamson-2022"), "IB, II, III"),
        (lambda: water.jerlov("II", 800e-9), "300 to 700 nm"),
        (lambda: water.jerlov("II", GREEN, source="x"), "solonenko-2015"),
        (lambda: water.jerlov("I", GREEN, source="paper"), '"II"'),
        (lambda: water.jerlov("3C", 690e-9), "300 to 650 nm"),
        (lambda: water.water_type("II", GREEN), "jerlov-II"),
        (lambda: metal_index("gold"), "silver or nickel"),
        (lambda: metal_index("silver", 1064e-9), "527 to 537 nm"),
        (lambda: metal_index("nickel", data_set="Jiang"), "Johnson"),
    ],
)
def test_outside_its_range_everything_is_refused(call, said: str) -> None:
    with pytest.raises(InputError, match=said):
        call()


def test_jerlov_types() -> None:
    paper = water.water_type("jerlov-II paper", GREEN)
    assert paper.attenuation == pytest.approx(0.42)
    assert paper.albedo == pytest.approx(0.89)
    table = water.water_type("Jerlov-ii", GREEN)
    assert (table.name, table.source, table.doubts) == ("II", "solonenko-2015", ())
    assert table.attenuation == pytest.approx(0.430, abs=1e-3)
    assert table.albedo == pytest.approx(0.881, abs=1e-3)
    measured = water.jerlov("II", GREEN, source="williamson-2022")
    assert (measured.absorption, measured.scattering) == (0.0618, 0.179)
    assert water.jerlov("I", GREEN).doubts == ("suspect",)


def test_metals() -> None:
    assert metal_index("silver") == pytest.approx(0.05400722 - 3.42898917j)
    assert metal_index("nickel", data_set="Rakic-LD") == pytest.approx(1.776172515 - 3.157892398j)
