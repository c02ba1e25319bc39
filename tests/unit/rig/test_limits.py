"""Limits: what is allowed goes out, what is not leaves no byte on the wire."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rig
from rig.limits import read_limits
from tests.unit.rig.bad_line import Bench, bench, generous_limits

GOOD = {
    "model": "dg645",
    "serial": "004025",
    "max_width": "10 ns",
    "earliest_opening": "50 ns",
    "max_rate": "1 kHz",
    "max_duty": 1e-4,
    "max_amplitude": "4 V",
    "polarities": ["positive"],
    "triggers": ["external rising"],
}
STEP = {"dg645": 5, "bnc575": 250}


def opened(model: str, **changes: Any) -> Bench:
    made = bench(model, limits=generous_limits(model, **changes))
    made.box.open()
    made.link.written.clear()
    return made


def test_the_shipped_limits_are_read() -> None:
    limits = rig.load_limits(Path(__file__).parents[3] / "data/rig/limits.toml")
    assert (limits.output, limits.max_width_ps, limits.serial) == ("AB", 20_000, "004025")
    assert len(limits.digest) == 64


def test_all_faults_of_a_file_are_told_together(tmp_path: Path) -> None:
    file = tmp_path / "limits.toml"
    file.write_text('model = "dg645"\nserial = "1"\nmax_widht = "3 ns"\nmax_duty = 1\nmax_rate = "1 kHz"\n')
    with pytest.raises(rig.PlanError) as told:
        rig.load_limits(file)
    assert "Did you mean 'max_width'" in str(told.value)
    assert "earliest_opening" in str(told.value) and "polarities" in str(told.value)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("max_width", "3 m"),
        ("max_width", "-3 ns"),
        ("max_rate", float("nan")),
        ("max_duty", float("inf")),
        ("polarities", "positive"),
        ("triggers", []),
        ("output", "Q"),
        ("model", "dg7"),
        ("schema", 2),
    ],
)
def test_nonsense_in_a_limit_is_refused(key: str, value: object) -> None:
    with pytest.raises(rig.PlanError):
        read_limits(GOOD | {key: value})


@pytest.mark.parametrize("model", ["dg645", "bnc575"])
@pytest.mark.parametrize(
    ("limit", "name"), [("max_width", "width"), ("earliest_opening", "delay"), ("max_duty", "duty")]
)
def test_the_limit_itself_passes_and_one_step_beyond_does_not(model: str, limit: str, name: str) -> None:
    step = STEP[model]
    rate = Fraction(1000)
    value = {"max_width": "20 ns", "earliest_opening": "100 ns", "max_duty": float(rate * 20_000 / 10**12)}
    made = opened(model, **{limit: value[limit], "max_rate": "1 kHz"})
    inside = rig.plan_gate(delay="100 ns", width="20 ns", model=model, rate=rate)
    over = {
        "width": rig.plan_gate(delay="100 ns", width=Fraction(20_000 + step, 10**12), model=model, rate=rate),
        "delay": rig.plan_gate(delay=Fraction(100_000 - step, 10**12), width="20 ns", model=model, rate=rate),
    }
    over["duty"] = over["width"]
    assert made.box.apply(inside).delay_ps == 100_000
    made.link.written.clear()
    with pytest.raises(rig.LimitError):
        made.box.apply(over[name])
    assert made.link.written == b""


@pytest.mark.parametrize(
    ("name", "at", "beyond"),
    [("amplitude", "4 V", "4.01 V"), ("offset", "0.5 V", "0.51 V"), ("polarity", "positive", "negative")],
)
def test_levels_have_limits_too(name: str, at: str, beyond: str) -> None:
    made = opened("dg645", max_amplitude="4 V", max_offset="0.5 V", polarities=["positive"])
    made.box.set(name, at, "AB")
    made.link.written.clear()
    with pytest.raises(rig.LimitError):
        made.box.set(name, beyond, "AB")
    assert made.link.written == b""


@settings(max_examples=150, deadline=None)
@given(
    delay=st.integers(0, 400_000),
    width=st.integers(5, 60_000),
    rate=st.one_of(st.none(), st.integers(1, 3_000)),
    trigger=st.sampled_from(["external rising", "internal", "line"]),
    polarity=st.sampled_from([None, "positive", "negative"]),
    amplitude=st.one_of(st.none(), st.integers(400, 5200)),
)
def test_a_refused_plan_leaves_no_byte_on_the_wire(
    delay: int, width: int, rate: int | None, trigger: str, polarity: str | None, amplitude: int | None
) -> None:
    made = REFUSING
    made.link.written.clear()
    volts = None if amplitude is None else Fraction(amplitude, 1000)
    plan = rig.plan_gate(
        delay=Fraction(delay, 10**12),
        width=Fraction(width, 10**12),
        rate=rate,
        trigger=trigger,
        polarity=polarity,
        amplitude=volts,
    )
    duty = Fraction(plan.width_ps, 10**12) * (rate or 1000)
    allowed = (
        plan.delay_ps >= 50_000
        and plan.width_ps <= 10_000
        and (rate or 0) <= 1000
        and duty <= Fraction(1, 10**5)
        and trigger == "external rising"
        and polarity != "negative"
        and (amplitude is None or 500 <= amplitude <= 4000)
    )
    try:
        applied = made.box.apply(plan)
    except rig.PlanError:
        assert not allowed
        assert made.link.written == b""
    else:
        assert allowed
        assert (applied.delay_ps, applied.width_ps) == (plan.delay_ps, plan.width_ps)


REFUSING = bench("dg645", limits=read_limits(GOOD | {"max_duty": 1e-5}))
REFUSING.box.open()


def test_a_scan_whose_last_step_is_too_early_sends_nothing() -> None:
    made = opened("dg645", earliest_opening="100 ns")
    plan = rig.plan_gate("40 m")
    sweep = rig.plan_scan(plan, start="99 ns", stop="200 ns", points=5)
    with pytest.raises(rig.LimitError, match="earliest_opening"):
        list(rig.run_scan(made.box, sweep))
    assert made.link.written == b""


def test_without_limits_a_gate_is_programmed_but_never_armed() -> None:
    made = bench("dg645")
    with made.box as box:
        box.apply(rig.plan_gate("40 m"))
        for forbidden in (
            box.arm,
            lambda: box.set("polarity", "negative", "AB"),
            lambda: box.set("trigger_source", "internal"),
        ):
            made.link.written.clear()
            with pytest.raises(rig.LimitError, match="limits file"):
                forbidden()
            assert made.link.written == b""


def test_arming_looks_at_what_the_box_holds_not_at_what_was_sent() -> None:
    made = opened("dg645", polarities=["positive"])
    made.box.apply(rig.plan_gate("40 m"))
    made.told("DLAY?2")
    made.device.feed("LPOL1,0")  # somebody at the panel
    with pytest.raises(rig.LimitError, match="polarity"):
        made.box.arm()
    assert made.told("TSRC?") == "5"
    made.device.feed("LPOL1,1")
    made.box.arm()
    assert made.told("TSRC?") == "1"


def test_the_wrong_box_is_refused() -> None:
    made = bench("dg645", limits=generous_limits("dg645", serial="004026"))
    with pytest.raises(rig.LimitError, match=r"004025.*004026"):
        made.box.open()
    assert b"DLAY2" not in made.link.written


def test_a_box_found_running_is_stopped_before_anything_else_is_set() -> None:
    made = bench("dg645", limits=generous_limits("dg645"))
    made.device.feed("TSRC1")
    made.box.open()
    made.link.written.clear()
    made.box.set("delay", "300 ns")
    assert made.link.written.startswith(b"TSRC5")
    assert made.told("TSRC?") == "5"


def test_outputs_that_hang_on_the_gate_stop_an_impossible_move() -> None:
    made = bench("dg645", limits=generous_limits("dg645"))
    made.device.feed("DLAY2,0,0.5")
    made.device.feed("DLAY4,2,-0.4")
    with made.box as box, pytest.raises(rig.PlanError, match=r"CD\.delay"):
        box.apply(rig.plan_gate(delay="100 ns"))


def test_a_burst_is_not_a_way_around_the_rate() -> None:
    made = opened("dg645", max_rate="1 kHz")
    made.box.apply(rig.plan_gate("40 m"))
    made.box.set("burst_period", "100 us")
    made.box.set("burst", True)
    with pytest.raises(rig.LimitError, match="rate"):
        made.box.arm()
    made.box.set("burst_period", "1 ms")
    assert made.box.arm().read == "external rising"


def test_recalled_levels_are_looked_at() -> None:
    made = opened("dg645", polarities=["positive"])
    made.device.feed("LPOL1,0")
    made.device.feed("*SAV4")
    made.device.feed("LPOL1,1")
    with pytest.raises(rig.LimitError, match="polarity"):
        made.box.recall(4)
    assert made.told("TSRC?") == "5"
    without = bench("dg645")
    without.box.open()
    with pytest.raises(rig.LimitError, match="limits file"):
        without.box.recall(4)
