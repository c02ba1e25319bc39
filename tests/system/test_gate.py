"""``imclab gate`` from the command line: plans, live runs against a simulated box, and rude endings."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import rig
from imclab.cli import run
from rig.simulator import SimulatorServer

ROOT = Path(__file__).parents[2]
LIMITS = ROOT / "data/rig/limits.toml"


@pytest.fixture
def box() -> Iterator[SimulatorServer]:
    with rig.simulate("dg645") as simulated:
        yield simulated


def gate(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> Any:
    """Run a command with --json and return what it printed; or its words on stderr when it fails."""
    assert run(["gate", *words, "--json"]) == code
    told = capsys.readouterr()
    if code:
        assert told.out == ""
        assert "Traceback" not in told.err
        return told.err
    return json.loads(told.out)


def live(simulated: SimulatorServer, tmp_path: Path) -> list[str]:
    journal = str(tmp_path / "journal.jsonl")
    return ["--port", simulated.url, "--limits", str(LIMITS), "--live", "--journal", journal]


def test_a_plan_needs_a_distance_alone(capsys: pytest.CaptureFixture[str]) -> None:
    plan = gate(capsys, "plan", "--distance", "40 m")
    closed = 2 * 1.357 * 40 / 299_792_458 * 1e12 - 85_000
    assert plan["wanted_delay_ps"] == pytest.approx(closed, abs=1e-3)
    assert abs(plan["delay_ps"] - closed) <= 2.5
    assert plan["convention"] == "front"
    assert run(["gate", "plan", "--distance", "40 m"]) == 0
    words = capsys.readouterr().out
    assert (
        "277.115 ns" in words
        and "gate opens when the return's leading edge arrives" in words
        and "█" in words
    )


def test_a_plan_out_of_reach_says_what_would_help(capsys: pytest.CaptureFixture[str]) -> None:
    told = gate(capsys, "plan", "--distance", "1 m", code=2)
    assert "9.39 m" in told and "pretrigger" in told


def test_a_gate_file_holds_the_constants_and_options_win(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = str(ROOT / "data/rig/gate.toml")
    from_file = gate(capsys, "plan", "--gate", file, "--distance", "20 m")
    assert from_file["parts_ps"]["tube"] == -35_000
    shorter = gate(capsys, "plan", "--gate", file, "--distance", "20 m", "--tube", "5 ns")
    assert shorter["delay_ps"] - from_file["delay_ps"] == 30_000
    broken = tmp_path / "gate.toml"
    broken.write_text('pluse = "4 ns"\n')
    assert "Did you mean 'pulse'" in gate(capsys, "plan", "--gate", str(broken), "--distance", "20 m", code=2)


def test_the_diagram_is_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    gate(capsys, "plan", "--distance", "40 m", "--plot", str(tmp_path / "gate.png"))
    assert (tmp_path / "gate.png").read_bytes().startswith(b"\x89PNG")
    assert len(list(tmp_path.iterdir())) == 1


def test_outputs_that_cannot_be_written_are_told_beforehand(
    capsys: pytest.CaptureFixture[str], box: SimulatorServer, tmp_path: Path
) -> None:
    assert ".png" in gate(capsys, "plan", "--distance", "40 m", "--plot", str(tmp_path / "gate"), code=2)
    words = ["scan", "--distance", "40 m", "-o", str(tmp_path / "no" / "steps.csv"), *live(box, tmp_path)]
    assert "make it first" in gate(capsys, *words, code=2)
    assert box.received == b""


def test_a_dry_run_is_the_default_and_needs_no_port(
    capsys: pytest.CaptureFixture[str], box: SimulatorServer
) -> None:
    told = gate(capsys, "set", "--distance", "40 m", "--port", box.url)
    assert told["live"] is False
    assert any("DLAY2,0,0.000000277115" in block for block in told["sent"])
    assert box.received == b""


def test_a_live_set_is_read_back_and_ends_with_the_triggers_off(
    capsys: pytest.CaptureFixture[str], box: SimulatorServer, tmp_path: Path
) -> None:
    dry = gate(capsys, "set", "--distance", "40 m", "--limits", str(LIMITS))
    told = gate(capsys, "set", "--distance", "40 m", *live(box, tmp_path))
    assert (told["read_delay_ps"], told["read_width_ps"]) == (277_115, 3_000)
    assert told["sent"] == dry["sent"]
    assert box.device.feed("DLAY?2") == "0,+0.000000277115"
    assert box.device.feed("TSRC?") == "5"
    settings = gate(capsys, "status", "--port", box.url)["settings"]
    assert settings["AB"]["delay_ps"] == 277_115
    assert gate(capsys, "status", "--journal", str(tmp_path / "journal.jsonl"))["settings"] == settings


def test_armed_for_a_while_then_safe(
    capsys: pytest.CaptureFixture[str], box: SimulatorServer, tmp_path: Path
) -> None:
    assert run(["gate", "set", "--distance", "40 m", *live(box, tmp_path), "--arm", "--hold", "0.1 s"]) == 0
    assert "ARMED" in capsys.readouterr().err
    assert b"TSRC1\n" in box.received
    assert box.device.feed("TSRC?") == "5"


@pytest.mark.parametrize(
    "words",
    [
        ["set", "--distance", "40 m", "--width", "20.005 ns"],
        ["set", "--distance", "13 m"],
        ["set", "--distance", "40 m", "--trigger", "internal"],
        ["set", "--distance", "40 m", "--rate", "2 kHz"],
        ["set", "--distance", "40 m", "--polarity", "negative"],
        ["set", "--distance", "40 m", "--output", "CD"],
        ["scan", "--distance", "40 m", "--from", "13 m", "--to", "41 m", "--step", "1 m"],
    ],
)
def test_what_the_limits_forbid_sends_not_one_byte(
    capsys: pytest.CaptureFixture[str], box: SimulatorServer, tmp_path: Path, words: list[str]
) -> None:
    assert "refused" in gate(capsys, *words, *live(box, tmp_path), code=2)
    assert box.received == b""


def test_the_wrong_box_and_missing_files_are_told(
    capsys: pytest.CaptureFixture[str], box: SimulatorServer, tmp_path: Path
) -> None:
    other = tmp_path / "limits.toml"
    other.write_text(LIMITS.read_text().replace("004025", "004026"))
    words = ["set", "--distance", "40 m", "--port", box.url, "--live", "--journal", str(tmp_path / "j")]
    assert "004026" in gate(capsys, *words, "--limits", str(other), code=2)
    assert b"DLAY2" not in box.received
    assert "--limits" in gate(capsys, *words, code=2)
    assert "No such file" in gate(capsys, *words, "--limits", str(tmp_path / "none.toml"), code=2)
    assert "--port" in gate(capsys, "status", code=2)
    gate(capsys, "status", "--port", "socket://127.0.0.1:1", code=3)


def test_a_scan_writes_its_steps_and_finds_the_target(
    capsys: pytest.CaptureFixture[str], box: SimulatorServer, tmp_path: Path
) -> None:
    camera = tmp_path / "camera.py"
    camera.write_text("import sys; d = float(sys.argv[1]); print(max(0, 4500 - abs(d - 277_115)) + 1)")
    words = ["scan", "--distance", "40 m", "--from", "38.6 m", "--to", "41.4 m", "--points", "15"]
    words += ["--grab", f"{sys.executable} {camera} {{delay_ps}}", "-o", str(tmp_path / "steps.csv")]
    told = gate(capsys, *words, *live(box, tmp_path))
    assert told["steps"] == 15
    rows = list(csv.DictReader((tmp_path / "steps.csv").read_text().splitlines()))
    assert all(row["sent_ps"] == row["read_ps"] for row in rows)
    assert told["target"]["delay_ps"] == pytest.approx(277_115, abs=3 * told["target"]["delay_stderr_ps"])
    assert box.device.feed("TSRC?") == "5"


def test_a_failing_camera_command_is_told_and_the_box_is_safe(
    capsys: pytest.CaptureFixture[str], box: SimulatorServer, tmp_path: Path
) -> None:
    words = ["scan", "--distance", "40 m", "--from", "39 m", "--to", "41 m", "--grab", "false"]
    assert "false" in gate(capsys, *words, *live(box, tmp_path), code=2)
    assert box.device.feed("TSRC?") == "5"
    assert box.device.feed("DLAY?3") == "2,+0.000000000005"


def test_off_makes_a_dangerous_box_safe(
    capsys: pytest.CaptureFixture[str], box: SimulatorServer, tmp_path: Path
) -> None:
    for line in ("TSRC1", "DLAY3,2,0.001"):
        box.device.feed(line)
    words = ["off", "--port", box.url, "--journal", str(tmp_path / "journal.jsonl")]
    assert gate(capsys, *words)["safe"] is True
    assert (box.device.feed("TSRC?"), box.device.feed("DLAY?3")) == ("5", "2,+0.000000000005")
    told = gate(capsys, "off", "--port", "socket://127.0.0.1:1", *words[3:], code=3)
    assert "NOT CONFIRMED SAFE" in told


def started(*words: str, folder: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "imclab", "gate", *words]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder, env=environment
    )


def scanning(box: SimulatorServer, tmp_path: Path, *more: str) -> subprocess.Popen[str]:
    """Start a long armed scan, and return when it is in its midst."""
    words = ["scan", "--distance", "40 m", "--from", "39 m", "--to", "41 m", "--points", "2000"]
    words += ["--dwell", "20 ms", "-o", str(tmp_path / "steps.csv"), *live(box, tmp_path), *more]
    process = started(*words, folder=tmp_path)
    for _ in range(400):
        if box.received.count(b"TSRC1\n") > 3:
            return process
        time.sleep(0.05)
    process.kill()
    raise AssertionError(process.communicate()[1])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_in_mid_scan_ends_safe_with_its_steps_saved(
    box: SimulatorServer, tmp_path: Path, number: signal.Signals
) -> None:
    process = scanning(box, tmp_path)
    process.send_signal(number)
    told = process.communicate(timeout=30)[1]
    assert process.returncode == 130
    assert "Traceback" not in told
    assert (box.device.feed("TSRC?"), box.device.feed("DLAY?3")) == ("5", "2,+0.000000000005")
    assert len((tmp_path / "steps.csv").read_text().splitlines()) > 3
    kinds = [(entry.kind, entry.text) for entry in rig.journal.read_journal(tmp_path / "journal.jsonl")]
    assert kinds[-2:] == [("note", "safe state confirmed"), ("close", "failed")]


def test_unplugging_for_good_in_mid_scan_says_not_confirmed_safe(
    box: SimulatorServer, tmp_path: Path
) -> None:
    process = scanning(box, tmp_path)
    box.unplug(3600)
    told = process.communicate(timeout=60)[1]
    assert process.returncode == 3
    assert "NOT CONFIRMED SAFE" in told and "Traceback" not in told


def test_a_port_that_comes_back_in_mid_scan_is_made_safe(box: SimulatorServer, tmp_path: Path) -> None:
    process = scanning(box, tmp_path)
    box.unplug(0.2)
    told = process.communicate(timeout=60)[1]
    assert process.returncode == 3 and "NOT CONFIRMED" not in told
    assert box.device.feed("TSRC?") == "5"


def test_killed_in_mid_scan_the_journal_tells_what_the_box_holds(
    box: SimulatorServer, tmp_path: Path
) -> None:
    process = scanning(box, tmp_path)
    process.kill()
    process.communicate(timeout=30)
    time.sleep(0.2)
    replayed = rig.replay(tmp_path / "journal.jsonl")
    with rig.open_generator(box.url, read_only=True) as reader:  # the lock of the dead is gone
        truth = reader.inherited
    different = {name for name, _, _ in rig.differences(truth, replayed.settings)}
    if different:  # killed between the journal and the wire: one block, and the replay says so
        assert replayed.unconfirmed and different <= {"AB.delay_ps", "trigger_source"}


def test_simulate_prints_its_address_first_and_serves_raw_sockets(tmp_path: Path) -> None:
    import socket

    process = started("simulate", "--model", "dg645", "--tcp", "127.0.0.1:0", folder=tmp_path)
    assert process.stdout is not None
    address = re.search(r"(\d+\.\d+\.\d+\.\d+):(\d+)", process.stdout.readline())
    assert address is not None
    with socket.create_connection((address[1], int(address[2])), timeout=5) as connection:
        connection.sendall(b"*IDN?\r\n")
        assert connection.recv(100).endswith(b"ver1.14.10E\r\n")
    process.send_signal(signal.SIGINT)
    assert "Traceback" not in process.communicate(timeout=20)[1]
    assert process.returncode == 130


def test_simulate_tells_machines_in_one_line_of_json(tmp_path: Path) -> None:
    link = tmp_path / "box"
    process = started(
        "simulate", "--model", "bnc575", "--pty", "--link", str(link), "--json", folder=tmp_path
    )
    assert process.stdout is not None
    told = json.loads(process.stdout.readline())
    assert told["pty"] == os.path.realpath(link)
    with rig.open_generator(str(link), model="bnc575", read_only=True) as reader:
        assert reader.identity.maker == "QC"
    process.terminate()
    process.communicate(timeout=20)
    assert not link.is_symlink()
