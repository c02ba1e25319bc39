"""Sweeps: constant steps on the grid, triggers on only while somebody looks, and the target found."""

from __future__ import annotations

import csv
import random
from math import sqrt
from pathlib import Path

import pytest

import rig
from tests.unit.rig.bad_line import bench, generous_limits


def test_steps_are_constant_and_on_the_grid() -> None:
    plan = rig.plan_gate("40 m")
    sweep = rig.plan_scan(plan, start="39 m", stop="41 m", step="1 cm")
    steps = {after - before for before, after in zip(sweep.delays_ps, sweep.delays_ps[1:], strict=False)}
    assert steps == {sweep.step_ps} == {90}
    assert sweep.delays_ps[-1] >= rig.plan_gate("41 m").delay_ps - 45
    assert sweep.step_m == pytest.approx(0.00994, abs=1e-5)


def test_distances_and_delays_say_the_same() -> None:
    plan = rig.plan_gate("40 m", convention="centre")
    metres = rig.plan_scan(plan, start="40 m", stop="41 m", points=3)
    assert metres.delays_ps[0] == plan.delay_ps
    nanoseconds = rig.plan_scan(
        plan, start=f"{metres.delays_ps[0]} ps", stop=f"{metres.delays_ps[-1]} ps", points=3
    )
    assert nanoseconds.delays_ps == pytest.approx(metres.delays_ps, abs=5)


def test_a_sweep_without_ends_goes_around_the_target() -> None:
    plan = rig.plan_gate("40 m")
    sweep = rig.plan_scan(plan)
    assert sweep.delays_ps[0] == pytest.approx(plan.delay_ps - 15_000, abs=5)
    assert plan.delay_ps + 15_000 <= sweep.delays_ps[-1] < plan.delay_ps + 15_000 + sweep.step_ps
    assert rig.plan_scan(rig.plan_gate("9.5 m")).delays_ps[0] == 0


def test_coarse_is_half_and_fine_a_sixth_of_the_depth_of_field() -> None:
    plan = rig.plan_gate("40 m")
    assert rig.plan_scan(plan, start="39 m", stop="41 m").step_ps == 2250
    assert rig.plan_scan(plan, start="39 m", stop="41 m", fineness="fine").step_ps == 750


@pytest.mark.parametrize(
    "arguments",
    [
        {"start": "41 m", "stop": "39 m"},
        {"start": "1 m", "stop": "39 m"},
        {"start": "39 m", "stop": "41 m", "points": 0},
        {"start": "39 m", "stop": "41 m", "step": "0 m"},
        {"start": "10 m", "stop": "90 m", "step": "1 um"},
        {"start": "39", "stop": "41 m"},
    ],
)
def test_a_sweep_that_cannot_be_is_refused(arguments: dict[str, str]) -> None:
    with pytest.raises(rig.PlanError):
        rig.plan_scan(rig.plan_gate("40 m"), **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("model", ["dg645", "bnc575"])
def test_the_triggers_run_only_while_a_frame_is_taken(model: str) -> None:
    made = bench(model, limits=generous_limits(model))
    seen: list[tuple[int, int]] = []

    def grab(step: rig.ScanStep) -> float:
        assert made.device.trigger("external rising")
        rise = next(edge for edge in made.device.edges if edge.output == plan.output)
        seen.append((step.read_ps, rise.time_ps))
        made.device.advance(10**9)
        made.device.edges.clear()
        return 1.0

    plan = rig.plan_gate("40 m", model=model)
    sweep = rig.plan_scan(plan, start="39.8 m", stop="40.2 m", points=4)
    with made.box as box:
        steps = list(rig.run_scan(box, sweep, grab=grab))
        assert not made.device.edges
    base = [at - 10**9 * index for index, (_, at) in enumerate(seen)]
    assert base == [read for read, _ in seen] == [step.sent_ps for step in steps]
    assert not made.device.trigger("external rising")  # the with block stopped it
    stop = b"TSRC5\n" if model == "dg645" else b":PULSE0:STATE 0"
    move = b"DLAY2,0" if model == "dg645" else b":PULSE1:DEL "
    written = bytes(made.link.written)
    places = [at for at in range(len(written)) if written.startswith(move, at)]
    assert all(written.rfind(stop, 0, at) > written.rfind(b"TSRC1", 0, at) for at in places)


def test_nobody_looking_the_triggers_stay_off() -> None:
    made = bench("dg645")
    with made.box as box:
        sweep = rig.plan_scan(rig.plan_gate("40 m"), start="39 m", stop="41 m", points=20)
        steps = list(rig.run_scan(box, sweep))
    assert len(steps) == 20
    assert b"TSRC1" not in made.link.written


def test_a_failing_camera_ends_the_sweep_safe() -> None:
    made = bench("dg645", limits=generous_limits("dg645"))
    sweep = rig.plan_scan(rig.plan_gate("40 m"), start="39 m", stop="41 m", points=20)

    def grab(step: rig.ScanStep) -> float:
        if step.index == 3:
            raise OSError("no frame")
        return 1.0

    with pytest.raises(OSError, match="no frame"), made.box as box:
        list(rig.run_scan(box, sweep, grab=grab))
    assert made.told("TSRC?") == "5"
    assert made.told("DLAY?3") == "2,+0.000000000005"


def test_steps_are_written_whole(tmp_path: Path) -> None:
    with rig.open_generator(None) as box:
        sweep = rig.plan_scan(rig.plan_gate("40 m"), start="39 m", stop="40 m", points=3)
        steps = list(rig.run_scan(box, sweep))
    rig.write_steps(tmp_path / "steps.csv", steps)
    rows = list(csv.DictReader((tmp_path / "steps.csv").read_text().splitlines()))
    assert [int(row["read_ps"]) for row in rows] == [step.sent_ps for step in steps]
    assert [path.name for path in tmp_path.iterdir()] == ["steps.csv"]


def profile(plan: rig.GatePlan, delay_ps: float, target_m: float) -> float:
    """Overlap of a rectangular gate at a delay with the rectangular return of a target."""
    opens = delay_ps + float(plan.electronics_ps)
    returns = target_m / plan.metres_per_ps
    overlap = min(opens + plan.width_ps, returns + float(plan.pulse_ps)) - max(opens, returns)
    return max(0.0, overlap) / plan.width_ps


def sweep_of(noise: float, seed: int, target: float) -> tuple[rig.GatePlan, list[int], list[float]]:
    plan = rig.plan_gate("40 m")
    delays = list(rig.plan_scan(plan, start="38.5 m", stop="41.5 m", step="6 cm").delays_ps)
    chosen = random.Random(seed)
    return plan, delays, [profile(plan, delay, target) + chosen.gauss(0, noise) for delay in delays]


def test_the_target_is_found_with_an_honest_uncertainty() -> None:
    """Pulls of 300 sweeps: mean near 0, spread near 1 (standard errors 0.06, 0.04; the rest is the grid)."""
    pulls = []
    for seed in range(300):
        target = 39.9 + random.Random(seed).random() * 0.2
        plan, delays, signal = sweep_of(0.03, seed, target)
        found = rig.find_target(plan, delays, signal)
        pulls.append((found.distance_m - target) / found.distance_stderr_m)
    mean = sum(pulls) / len(pulls)
    spread = sqrt(sum((pull - mean) ** 2 for pull in pulls) / (len(pulls) - 1))
    assert abs(mean) < 0.25
    assert 0.6 < spread < 1.3


def test_a_target_found_a_gate_away_would_be_rejected() -> None:
    plan, delays, signal = sweep_of(0.03, 1, 40.0)
    found = rig.find_target(plan, delays, signal)
    assert abs(found.distance_m - 40.0) < 5 * found.distance_stderr_m < 0.1
    assert abs(found.distance_m - (40.0 + 3000 * plan.metres_per_ps)) > 5 * found.distance_stderr_m
    assert found.uncertainty_m > found.distance_stderr_m


def test_no_peak_and_half_a_peak_are_refused() -> None:
    plan, delays, signal = sweep_of(0.03, 1, 60.0)
    with pytest.raises(rig.PlanError, match="noise"):
        rig.find_target(plan, delays, signal)
    plan, delays, signal = sweep_of(0.001, 1, 41.6)
    with pytest.raises(rig.PlanError, match="Sweep farther"):
        rig.find_target(plan, delays, signal)
    with pytest.raises(rig.PlanError, match="at least 5"):
        rig.find_target(plan, delays[:3], signal[:3])


@pytest.mark.parametrize("looking", [True, False])
def test_a_power_cut_in_mid_scan_does_not_pass(looking: bool) -> None:
    """The delay is set anew at the next step, but the width is that of power-up: 10 ns for 3 ns."""
    made = bench("dg645", limits=generous_limits("dg645"))
    sweep = rig.plan_scan(rig.plan_gate("40 m"), start="39 m", stop="41 m", points=10)
    widths = []

    def grab(step: rig.ScanStep) -> float:
        widths.append(made.told("DLAY?3"))
        if step.index == 4:
            made.device.power_cycle()
        return 1.0

    with pytest.raises(rig.ReadBackError, match="10000"), made.box as box:
        for step in rig.run_scan(box, sweep, grab=grab if looking else None):
            if step.index == 4 and not looking:
                made.device.power_cycle()
    assert widths == (["2,+0.000000003000"] * 5 if looking else [])


def test_a_hand_at_the_panel_is_seen_while_armed() -> None:
    made = bench("dg645", limits=generous_limits("dg645"))
    with made.box as box:
        plan = rig.plan_gate("40 m")
        box.apply(plan)
        box.arm()
        box.check_held(plan.delay_ps)
        made.device.feed("DLAY3,2,0.001")
        with pytest.raises(rig.ReadBackError, match="1000000000"):
            box.check_held(plan.delay_ps)
