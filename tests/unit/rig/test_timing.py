"""Gate plans against the closed form, written out here a second time with decimals alone."""

from __future__ import annotations

import itertools
from decimal import Decimal, getcontext

import pytest

import rig

getcontext().prec = 50
C = Decimal(299_792_458)

DISTANCES = ("0.5 m", "1 m", "9.4 m", "15.5 m", "40 m", "100 m")
WATERS = {"fresh": Decimal("1.357"), "sea": Decimal("1.364")}
CABLES = (("0 m", "0 m", Decimal(0)), ("2 m", "3.5 m", Decimal("5.5")))
BOXES = {"dg645": (Decimal("85e-9"), 5), "bnc575": (Decimal("155e-9"), 250)}
CONVENTIONS = {
    "front": Decimal(0),
    "centre": (Decimal("4.5e-9") - Decimal("10e-9")) / 2,
    "tail": Decimal("4.5e-9") - Decimal("10e-9"),
}


@pytest.mark.parametrize(("distance", "water"), [*itertools.product(DISTANCES, WATERS)])
def test_the_delay_is_the_closed_form_to_a_picosecond(distance: str, water: str) -> None:
    for cable, model, convention in itertools.product(CABLES, BOXES, CONVENTIONS):
        insertion, grid = BOXES[model]
        light = 2 * WATERS[water] * Decimal(distance.split(maxsplit=1)[0]) / C
        closed = light - insertion - cable[2] * Decimal("5e-9") - Decimal("35e-9") + CONVENTIONS[convention]
        closed_ps = (closed + Decimal("500e-9")) * 10**12
        plan = rig.plan_gate(
            distance,
            water=water,
            model=model,
            width="10 ns",
            cable_in=cable[0],
            cable_out=cable[1],
            tube="35 ns",
            pretrigger="500 ns",
            convention=convention,
        )
        assert abs(float(plan.wanted_delay_ps) - float(closed_ps)) < 1e-6
        assert plan.delay_ps % grid == 0
        assert abs(plan.delay_ps - float(closed_ps)) <= grid / 2 + 1e-6
        assert float(plan.quantisation_ps) == pytest.approx(plan.delay_ps - float(closed_ps), abs=1e-6)


@pytest.mark.parametrize("index", ["1.33", "1.335"])
def test_a_phase_index_is_a_whole_gate_early_at_twenty_metres(index: str) -> None:
    """Power: the closed form's tolerance rejects the commonest mistake."""
    right = rig.plan_gate("20 m")
    wrong = rig.plan_gate("20 m", group_index=index)
    assert 2_900 < right.delay_ps - wrong.delay_ps < 3_700


def test_text_floats_and_metres_say_the_same() -> None:
    assert rig.plan_gate("40 m").delay_ps == rig.plan_gate(40.0).delay_ps == rig.plan_gate("4000 cm").delay_ps


def test_a_calibrated_offset_stands_for_all_electronics() -> None:
    seen = rig.plan_gate("12 m", cable_in="2 m")
    offset = rig.calibrated_offset("12 m", f"{float(seen.wanted_delay_ps):.9f} ps")
    again = rig.plan_gate("20 m", offset=float(offset), offset_uncertainty="0.3 ns")
    assert again.delay_ps == rig.plan_gate("20 m", cable_in="2 m").delay_ps
    assert again.uncertainty_ps == pytest.approx(300)
    assert "calibrated" in again.uncertainty_source


def test_the_reach_floor_is_where_the_delay_is_zero() -> None:
    """85 ns alone are 9.4 m; two cables of 2 m and 35 ns of tube make it 15.5 m (fresh water)."""
    near = rig.plan_gate("16 m", cable_in="2 m", cable_out="2 m", tube="35 ns")
    assert near.reach_floor_m == pytest.approx(15.46, abs=0.01)
    assert rig.plan_gate("10 m").reach_floor_m == pytest.approx(9.39, abs=0.01)
    at_floor = rig.plan_gate(near.reach_floor_m + 1e-6, cable_in="2 m", cable_out="2 m", tube="35 ns")
    assert at_floor.delay_ps == 0


def test_nearer_than_the_floor_it_says_what_would_help() -> None:
    with pytest.raises(rig.PlanError, match=r"reach floor .* 9\.39 m.*pretrigger") as told:
        rig.plan_gate("1 m")
    assert told.value.exit_code == 2
    assert rig.plan_gate("1 m", pretrigger="100 ns").delay_ps == 24_055


def test_depth_of_field_of_two_rectangles() -> None:
    """3 ns gate, 5 ns pulse: 0.88 m full, 0.22 m flat, 0.55 m FWHM."""
    depth = rig.plan_gate("20 m", pulse="5 ns").depth_m
    assert [round(depth[name], 2) for name in ("full", "flat", "fwhm")] == [0.88, 0.22, 0.55]
    assert depth["fwhm_with_jitter"] > depth["fwhm"]


def test_conventions_are_named_and_place_the_return() -> None:
    plans = {name: rig.plan_gate("20 m", convention=name) for name in ("front", "centre", "tail")}
    assert plans["centre"].delay_ps - plans["front"].delay_ps == 750
    assert plans["tail"].delay_ps - plans["front"].delay_ps == 1500
    late = rig.plan_gate("20 m", convention="tail", tail_delay="2.2 ns")
    assert late.delay_ps - plans["front"].delay_ps == 2200
    assert "2.2 ns after" in late.convention_text
    assert len({plan.convention_text for plan in plans.values()}) == 3


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({}, "neither"),
        ({"distance": "1 m", "delay": "1 ns"}, "both"),
        ({"distance": "40 m", "width": "0 ns"}, "width"),
        ({"distance": "40 m", "width": "1 ps"}, "shortest"),
        ({"distance": "40 m", "model": "bnc575", "width": "3 ns"}, "at least 10 ns"),
        ({"distance": "-1 m"}, "distance"),
        ({"distance": "40 m", "water": "swamp"}, "'fresh' or 'sea'"),
        ({"distance": "40 m", "convention": "middle"}, "'centre'"),
        ({"distance": "40 m", "model": "dg654"}, "Did you mean 'dg645'"),
        ({"distance": "40 m", "output": "XY"}, "AB, CD, EF, GH"),
        ({"delay": "3000 s"}, "at most"),
        ({"distance": "40 m", "rate": "5 MHz"}, "rate"),
        ({"distance": "40 m", "group_index": "13"}, "1 to 2"),
        ({"distance": "40 m", "offset_uncertainty": "1 ns"}, "an offset with it"),
        ({"distance": "40 m", "tail_delay": "1 ns"}, "tail"),
    ],
)
def test_what_cannot_be_is_refused_in_plain_words(arguments: dict[str, str], told: str) -> None:
    with pytest.raises(rig.PlanError, match=told):
        rig.plan_gate(**arguments)  # type: ignore[arg-type]


def test_a_given_delay_is_programmed_as_such() -> None:
    plan = rig.plan_gate(delay="445.321 ns")
    assert (plan.delay_ps, float(plan.quantisation_ps)) == (445_320, -1)


def test_the_planner_needs_no_heavy_library() -> None:
    import subprocess
    import sys

    code = "import sys, rig; rig.plan_gate('40 m'); print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"numba", "cv2", "matplotlib", "numpy", "serial", "imclab"} & set(loaded)
