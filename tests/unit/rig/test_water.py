"""The group index of water, against the reference table and the optics package."""

from __future__ import annotations

import pytest

import imclab.optics.water as optics_water
from rig.errors import PlanError
from rig.water import TYPICAL_GROUP_INDEX, group_index

# Quan & Fry 1995, eq. 3, times the index of standard air (Ciddor 1996), differentiated with mpmath.
TABLE = [
    (400, 20, 0, 1.382009807),
    (532, 20, 0, 1.356953822),
    (700, 20, 0, 1.345247004),
    (532, 10, 35, 1.365155948),
    (532, 20, 35, 1.364191147),
    (700, 15, 38.4, 1.3532952),
]


@pytest.mark.parametrize(("nanometres", "celsius", "salinity", "wanted"), TABLE)
def test_agrees_with_the_reference(nanometres: float, celsius: float, salinity: float, wanted: float) -> None:
    assert group_index(nanometres, celsius, salinity) == pytest.approx(wanted, abs=2e-9)


def test_the_phase_index_would_be_rejected() -> None:
    assert abs(1.335406 - group_index(532, 20, 0)) > 0.02


def test_the_typical_values_are_those_of_twenty_degrees() -> None:
    for water, salinity in (("fresh", 0), ("sea", 35)):
        assert float(TYPICAL_GROUP_INDEX[water]) == pytest.approx(group_index(532, 20, salinity), abs=3e-4)


@pytest.mark.parametrize("arguments", [(399, 20, 0), (532, 31, 0), (532, 20, 41), (float("nan"), 20, 0)])
def test_outside_the_measurements_it_refuses(arguments: tuple[float, float, float]) -> None:
    with pytest.raises(PlanError, match="not measured"):
        group_index(*arguments)


def test_agrees_with_the_optics_package() -> None:
    """Two packages that may not know each other; one light."""
    for nanometres, celsius, salinity, _ in TABLE:
        other = optics_water.group_index(nanometres * 1e-9, temperature=celsius + 273.15, salinity=salinity)
        assert group_index(nanometres, celsius, salinity) == pytest.approx(float(other), abs=1e-7)
