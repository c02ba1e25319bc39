"""Every fault against every job: the right value, or a report; never a wrong value in silence."""

from __future__ import annotations

import re
from collections import Counter
from fractions import Fraction

import pytest

import rig
from rig.simulator import FAULTS
from tests.unit.rig.bad_line import Bench, bench, generous_limits

MODELS = ("dg645", "bnc575")
DELAY = {"dg645": ("DLAY?2", 445_320), "bnc575": (":PULSE1:DEL?", 445_250)}
CLOGS = {"slow-reply", "busy"}  # so many late answers queue up that the box stays deaf for a minute


def true_delay_ps(made: Bench, model: str) -> int:
    """What the device holds, read past every fault and without the driver's parser."""
    reply = made.told(DELAY[model][0]).split(",")[-1]
    return round(Fraction(reply) * 10**12)


def set_delay(made: Bench, model: str) -> None:
    made.faults.device.feed("*CLS")
    applied = made.box.set("delay", Fraction(DELAY[model][1], 10**12))
    assert applied.read == DELAY[model][1]
    assert true_delay_ps(made, model) == applied.read


def read_delay(made: Bench, model: str) -> None:
    assert made.box.read("delay") == true_delay_ps(made, model)
    level = made.box.read("trigger_level")
    wire = "TLVL?" if model == "dg645" else ":PULSE0:TRIG:LEV?"
    assert level == round(Fraction(made.told(wire)) * 1000)


def scan_delays(made: Bench, model: str) -> None:
    plan = rig.plan_gate("40 m", model=model)
    sweep = rig.plan_scan(plan, start="39.9 m", stop="40.1 m", points=4)
    for step in rig.run_scan(made.box, sweep):
        assert step.read_ps == step.sent_ps == true_delay_ps(made, model)
    width = made.told("DLAY?3" if model == "dg645" else ":PULSE1:WIDT?").split(",")[-1]
    assert round(Fraction(width) * 10**12) == plan.width_ps


JOBS = {"set": set_delay, "read": read_delay, "scan": scan_delays}


@pytest.fixture(autouse=True)
def _no_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.safe_state._BETWEEN_ATTEMPTS_S", 0.0)


def outcome(model: str, job: str, fault: str, *, after: int, count: int, seed: int) -> str:
    """Run one job on one bad line; a wrong value fails the assertions of the job."""
    made = bench(model, seed=seed, limits=generous_limits(model))
    made.box.open()
    made.faults.start(fault, after=after, count=count)
    try:
        JOBS[job](made, model)
        told = "recovered" if made.box.conversation.recoveries else "right"
    except rig.RigError:
        told = "reported"
    made.faults.clear()
    try:
        made.box.close(failed=told == "reported")
    except rig.NotConfirmedSafeError:
        return f"{told}, not confirmed safe"
    if job != "read" or told == "reported":
        assert made.told("TSRC?" if model == "dg645" else ":PULSE0:STATE?") in ("5", "0")
    return told


def outcomes_of(model: str, job: str, fault: str, *, seeds: int) -> Counter[str]:
    """Strike at the first, second and fifth reply, once and for ever."""
    return Counter(
        outcome(model, job, fault, after=after, count=count, seed=seed)
        for after in (0, 1, 4)
        for count in (1, -1)
        for seed in range(seeds)
    )


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("job", JOBS)
def test_no_fault_brings_a_wrong_value_in_silence(model: str, fault: str, job: str) -> None:
    outcomes = outcomes_of(model, job, fault, seeds=2)
    assert sum(outcomes.values()) == 12
    assert fault in CLOGS or not any("not confirmed" in told for told in outcomes), outcomes


@pytest.mark.parametrize("model", MODELS)
def test_a_driver_that_trusts_the_line_is_caught_by_this_bench(model: str) -> None:
    """Power: without asking twice and without the fence, the same faults do bring wrong values."""
    wrong = 0
    for seed in range(40):
        made = bench(model, seed=seed)
        made.box.open()
        made.faults.start("flip-bit", count=1)
        line = "TLVL?" if model == "dg645" else ":PULSE0:TRIG:LEV?"
        made.link.write(f"{line}\r\n".encode())
        reply = made.link.read_line(made.link.now() + 1).decode("latin-1").strip()
        number = re.fullmatch(r"[+-]?\d+\.\d+", reply)
        wrong += number is not None and reply.lstrip("+") != made.told(line).lstrip("+")
    assert wrong > 3
