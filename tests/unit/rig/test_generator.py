"""The face: who may open a port, what it leaves behind, and what it says when the line is lost."""

from __future__ import annotations

import threading

import pytest

import rig
from tests.unit.rig.bad_line import bench, generous_limits


def test_the_call_of_the_contract() -> None:
    for model in ("dg645", "bnc575"):
        with rig.simulate(model) as simulated, rig.open_generator(simulated.url, model=model) as box:
            gate = box.apply(rig.plan_gate("40 m", model=model))
            assert gate.delay_ps == gate.plan.delay_ps == box.read("delay")


def test_nothing_is_opened_before_the_with_block() -> None:
    box = rig.open_generator("socket://127.0.0.1:1", model="dg645")
    with pytest.raises(rig.LinkError, match="not open"):
        _ = box.identity
    with pytest.raises(rig.LinkError, match="not open"):
        box.read("delay")
    with pytest.raises(rig.LinkError, match="opening failed"):
        box.open()


@pytest.mark.parametrize("port", ["/dev/no-such-port", "nonsense://x", "socket://127.0.0.1:1"])
def test_a_port_that_is_not_there_is_told_with_exit_code_three(port: str) -> None:
    with pytest.raises(rig.LinkError) as told, rig.open_generator(port):
        pass
    assert told.value.exit_code == 3
    assert port.rsplit("//", maxsplit=1)[-1] in str(told.value)


def test_the_wrong_box_is_told() -> None:
    with (
        rig.simulate("bnc575") as simulated,
        pytest.raises(rig.ReplyError, match=r"QC,9534.*wanted a Stanford"),
        rig.open_generator(simulated.url, model="dg645", timeout="0.2 s"),
    ):
        pass


def test_one_owner_even_among_threads() -> None:
    with rig.simulate("dg645") as simulated, rig.open_generator(simulated.url) as box:
        told: list[str] = []

        def second() -> None:
            try:
                rig.open_generator(simulated.url).open()
            except rig.OwnedError as error:
                told.append(str(error))

        thread = threading.Thread(target=second)
        thread.start()
        thread.join()
        assert "pid" in told[0]
        assert box.read("trigger_source") == "off"
    with rig.simulate("dg645") as simulated, rig.open_generator(simulated.url) as box:
        assert box.errors() == []


def test_leaving_in_peace_keeps_the_gate_and_stops_the_triggers() -> None:
    made = bench("dg645", limits=generous_limits("dg645"))
    with made.box as box:
        box.apply(rig.plan_gate("40 m"))
        box.arm()
        assert made.told("TSRC?") == "1"
    assert (made.told("TSRC?"), made.told("DLAY?3")) == ("5", "2,+0.000000003000")


def test_leaving_in_trouble_narrows_the_gate_as_well() -> None:
    made = bench("bnc575", limits=generous_limits("bnc575"))
    with pytest.raises(ZeroDivisionError), made.box as box:
        box.apply(rig.plan_gate("40 m", model="bnc575", width="50 ns"))
        box.arm()
        raise ZeroDivisionError
    assert made.told(":PULSE0:STATE?") == "0"
    assert made.told(":PULSE1:STATE?") == "0"
    assert made.told(":PULSE1:WIDT?") == "0.00000001000"


def test_reading_alone_leaves_a_running_box_running() -> None:
    for read_only in (True, False):
        made = bench("dg645", read_only=read_only)
        made.device.feed("TSRC1")
        with made.box as box:
            assert box.read("trigger_source") == "external rising"
        assert made.told("TSRC?") == "1"


def test_read_only_refuses_every_set() -> None:
    made = bench("dg645", read_only=True)
    with made.box as box:
        made.link.written.clear()
        for forbidden in (
            lambda: box.apply(rig.plan_gate("40 m")),
            lambda: box.set("delay", "1 us"),
            box.disarm,
            lambda: box.save(1),
            lambda: box.move_gate(5),
        ):
            with pytest.raises(rig.PlanError):
                forbidden()
        assert made.link.written == b""


def test_a_lost_port_is_not_called_safe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.safe_state._BETWEEN_ATTEMPTS_S", 0.0)
    made = bench("dg645")
    monkeypatch.setattr(made.link, "open", lambda: None)
    with pytest.raises(rig.NotConfirmedSafeError, match="NOT CONFIRMED SAFE") as told, made.box as box:
        box.apply(rig.plan_gate("40 m"))
        made.faults.start("hang-up")
        box.read("delay")
    assert told.value.exit_code == 3
    assert isinstance(told.value.__context__, rig.LinkError)


def test_a_port_that_comes_back_is_made_safe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.safe_state._BETWEEN_ATTEMPTS_S", 0.0)
    made = bench("dg645", limits=generous_limits("dg645"))
    with pytest.raises(rig.LinkError), made.box as box:
        box.apply(rig.plan_gate("40 m"))
        box.arm()
        made.faults.start("hang-up")
        box.read("delay")
    assert made.told("TSRC?") == "5"


def test_a_late_reply_never_becomes_the_answer_to_another_question() -> None:
    """The off-by-one of other drivers: trigger_rate, level and holdoff answered with each other's values."""
    made = bench("dg645", limits=generous_limits("dg645"))
    with made.box as box:
        box.set("trigger_rate", "1 kHz")
        box.set("trigger_level", "2 V")
        box.set("holdoff", "3 us")
        for name in ("slow-reply", "late-reply"):
            made.faults.start(name, count=1)
            assert box.read("trigger_rate") == 10**9
            assert box.read("trigger_level") == 2000
            assert box.read("holdoff") == 3_000_000
        assert box.conversation.recoveries >= 2


def test_errors_left_by_others_are_not_blamed_on_the_first_set() -> None:
    made = bench("dg645")
    made.device.feed("BLAH")
    with made.box as box:
        assert box.apply(rig.plan_gate("40 m")).delay_ps == 277_115
        assert box.errors() == []


def test_a_power_cycle_is_noticed_not_overlooked() -> None:
    made = bench("dg645", limits=generous_limits("dg645"))
    with made.box as box:
        box.apply(rig.plan_gate("40 m"))
        made.device.power_cycle()
        with pytest.raises(rig.LimitError):
            box.limits = generous_limits("dg645", max_width="5 ns")
            box.arm()  # the box is back at 10 ns, which nobody sent
