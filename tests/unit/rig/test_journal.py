"""The journal: written before it is sent, whole lines only, and replayable."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import rig
from rig.conversation import Conversation
from rig.dg645 import DG645
from rig.dry_run import DryRunLink
from rig.generator import Generator
from rig.journal import Journal, read_journal
from rig.simulator import simulated_device
from tests.unit.rig.bad_line import generous_limits


@pytest.mark.parametrize("model", ["dg645", "bnc575"])
def test_a_session_replays_to_what_the_box_holds(model: str, tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with rig.simulate(model) as simulated:
        start = (
            "DLAY4,2,0.000001;LPOL3,0;TRAT123.456" if model == "dg645" else ":PULSE3:DEL 0.000001"
        ).split(";")
        for line in start:
            simulated.device.feed(line)
        limits = generous_limits(model)
        with rig.open_generator(simulated.url, model=model, limits=limits, journal=path) as box:
            box.apply(rig.plan_gate("40 m", model=model))
            box.arm("internal")
            box.set("delay", "512.5 ns", box.gate_output)
            truth = box.settings()
    replayed = rig.replay(path)
    truth["trigger_source"] = "off"  # leaving the with block stopped it
    if model == "bnc575":
        truth["A"]["enabled"] = False
    assert replayed.settings == truth
    assert replayed.unconfirmed == ""


class Eavesdropper(DryRunLink):
    """Looks into the journal at the moment of each send."""

    journal: Path

    def write(self, block: bytes) -> None:
        last = json.loads(self.journal.read_text().splitlines()[-1])
        assert (last["kind"], last["text"]) == ("sent", block.decode())
        super().write(block)


def test_every_block_is_in_the_file_before_it_is_sent(tmp_path: Path) -> None:
    link = Eavesdropper(simulated_device("dg645"))
    link.journal = tmp_path / "journal.jsonl"
    conversation = Conversation(link, DG645(), Journal(link.journal), timeout_s=1, baud=9600)
    with Generator(conversation, ownership=None, limits=None, read_only=False) as box:
        box.apply(rig.plan_gate("40 m"))
    assert sum(entry.kind == "sent" for entry in read_journal(link.journal)) > 8


def test_a_dry_run_sends_byte_for_byte_what_a_live_one_sends() -> None:
    blocks = []
    with rig.simulate("dg645") as simulated:
        for port in (None, simulated.url):
            with rig.open_generator(port, limits=generous_limits("dg645")) as box:
                box.apply(rig.plan_gate("40 m"))
                box.arm()
            blocks.append(box.conversation.journal.sent)
    assert blocks[0] == blocks[1]


def test_a_line_cut_by_a_crash_is_left_out_and_nonsense_is_told(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with rig.open_generator(None, journal=path) as box:
        box.apply(rig.plan_gate("40 m"))
    whole = rig.replay(path)
    with path.open("a") as file:
        file.write('{"utc": "2026-')
    assert rig.replay(path) == whole
    path.write_text("nonsense\nmore\n")
    with pytest.raises(rig.PlanError, match="line 1"):
        rig.replay(path)
    path.write_text("")
    with pytest.raises(rig.PlanError, match="no settings"):
        rig.replay(path)
