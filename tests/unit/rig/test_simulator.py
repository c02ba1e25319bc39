"""The simulated generators: the makers' protocols, line by line, and the transports that carry them."""

from __future__ import annotations

import json
import os
import socket
import time
from pathlib import Path

import pytest

import rig
from rig.simulator import FAULTS, simulated_device
from rig.simulator.bnc575 import SimulatedBNC575
from rig.simulator.dg645 import SimulatedDG645
from rig.simulator.faults import Faults
from rig.simulator.lines import CommandSplitter


@pytest.mark.parametrize(
    ("lines", "reply"),
    [
        (["*IDN?"], "Stanford Research Systems,DG645,s/n004025,ver1.14.10E"),
        (["DLAY?3"], "2,+0.000000010000"),
        (["DLAY 2,0,4.4532e-07", "DLAY? 2"], "0,+0.000000445320"),
        (["dlay2,0,1999.999999989995", "DLAY?2"], "0,+1999.999999989995"),
        (["DLAY 2,0,0.000000000003", "DLAY?2"], "0,+0.000000000005"),
        (["DLAY 2,0,-1", "LERR?"], "12"),
        (["DLAY 2,0,2000", "LERR?"], "12"),
        (["DLAY 2,3,0", "LERR?"], "13"),
        (["DLAY 0,2,0", "LERR?"], "13"),
        (["DLAY 2,1,0", "LERR?"], "13"),
        (["DLAY 2,0,1999.9999999999", "LERR?"], "12"),
        (["DLAY 2,0,1", "DLAY 4,2,-0.5", "DLAY 2,0,0.1", "LERR?"], "12"),
        (["DLAY 2,0,1", "DLAY 4,2,-0.5", "DLAY 2,0,0.1", "DLAY?2"], "0,+1.000000000000"),
        (["DLAY 2,0,1", "LINK 3,0", "DLAY?3"], "0,+1.000000010000"),
        (["TSRC 1", "TSRC?"], "1"),
        (["TSRC 9", "LERR?"], "10"),
        (["TSRC 9", "TSRC?"], "5"),
        (["TLVL 9", "LERR?"], "10"),
        (["LAMP 1,9", "LERR?"], "10"),
        (["LAMP 1,4.5", "LOFF 1,1.5", "LERR?"], "10"),
        (["TRAT 5e9", "LERR?"], "10"),
        (["TRAT 123.456789", "TRAT?"], "+123.456789"),
        (["BLAH", "LERR?"], "111"),
        (["TSR", "LERR?"], "110"),
        (["DLAY 2,0", "LERR?"], "116"),
        (["TSRC 1,2", "LERR?"], "115"),
        (["DLAY 2,,1", "LERR?"], "114"),
        (["DLAY 2,0,abc", "LERR?"], "118"),
        (["DLAY x,0,1", "LERR?"], "120"),
        (["TLVL 1.0000000000000000000000001", "LERR?"], "117"),
        (["*IDN", "LERR?"], "113"),
        (["*RST?", "LERR?"], "112"),
        (["*TRG", "*ESR?"], "128"),
        (["TSRC 1", "*TRG", "LERR?"], "11"),
        (["*RCL 4", "LERR?"], "14"),
        (["DLAY 2,0,1e-6", "*SAV 4", "*RST", "*RCL 4", "DLAY?2"], "0,+0.000001000000"),
        (["", "\r", "LERR?"], "0"),
        (["*OPC?"], "1"),
        (["BLAH", "*ESR?"], str(128 + 32)),
        (["TLVL 9", "*ESR?"], str(128 + 16)),
        (["BLAH", "*CLS", "LERR?"], "0"),
        (["PRES 1,5", "PRES?1"], "5"),
        (["SSDL 2,1e-9", "SPDL 2,1", "DLAY?2"], "0,+0.000000001000"),
    ],
)
def test_dg645_line_by_line(lines: list[str], reply: str) -> None:
    device = SimulatedDG645()
    for line in lines[:-1]:
        assert device.feed(line) is None or "?" in line
    assert device.feed(lines[-1]) == reply


def test_dg645_queue_holds_twenty_and_says_that_more_were_lost() -> None:
    device = SimulatedDG645()
    for _ in range(30):
        device.feed("BLAH")
    codes = [device.feed("LERR?") for _ in range(21)]
    assert codes == ["111"] * 19 + ["254", "0"]


def test_dg645_outputs_follow_triggers_and_links() -> None:
    device = SimulatedDG645()
    for line in ("TSRC1", "DLAY2,0,3e-7", "DLAY3,2,3e-9", "LPOL2,0"):
        device.feed(line)
    assert device.trigger("external rising")
    assert not device.trigger("external rising")  # a cycle runs
    assert device.feed("INSR?") == str(1 | 2)
    gate = [(edge.time_ps, edge.level) for edge in device.edges if edge.output == "AB"]
    inverted = [edge.level for edge in device.edges if edge.output == "CD"]
    assert gate == [(300_000, 1), (303_000, 0)]
    assert inverted == [0, 1]
    device.feed("TLVL2")
    assert device.feed("INSR?") == str(1 << 5)  # changing a setting cut the cycle short
    device.feed("TSRC5")
    device.advance(10**9)
    assert not device.trigger("external rising")


@pytest.mark.parametrize(
    ("lines", "reply"),
    [
        (["*IDN?"], "QC,9534,02311,1.2.2-1.2.0"),
        ([":PULSE1:WIDT?"], "0.00000010000"),
        ([":PULSE1:WIDTH 0.00012"], "ok"),
        ([":PULSE1:WIDT 0.00000044525", ":pulse1:widt?"], "0.00000044525"),
        ([":PULSE1:DEL -0.5", ":PULSE1:DELAY?"], "-0.50000000000"),
        ([":PULSE1:POL INV", ":PULSE1:POL?"], "INV"),
        ([":PULSE1:POLARITY INVERTED", ":PULSE1:POL?"], "INV"),
        ([":PULSE1:POLAR INV"], "?3"),
        (["PULSE1:POL?"], "?1"),
        ([":"], "?2"),
        ([":PULSE1"], "?2"),
        ([":PULSE1:POL"], "?4"),
        ([":PULSE1:POL SIDEWAYS"], "?5"),
        ([":PULSE1:WIDT 1e9"], "?5"),
        ([":PULSE1:WIDT nan"], "?5"),
        (["*IDN"], "?6"),
        (["*RST?"], "?7"),
        ([":PULSE7:WIDT?"], "?3"),
        ([":PULSE2:SYNC CHA", ":PULSE1:SYNC CHB"], "?5"),
        ([":SPULSE:STATE ON", ":PULSE0:STATE?"], "1"),
        ([":PULSE3:WIDT 1e-6", ":PULSE:WIDT?"], "0.00000100000"),
        ([":INST:CAT?"], "T0, CHA, CHB, CHC, CHD"),
        ([":SYST:COMM:SER:ECHO ON", ":PULSE0:STATE?"], ":PULSE0:STATE?\r\n0"),
        (["*SAV 2", ":PULSE1:WIDT 1e-6", "*RCL 2", ":PULSE1:WIDT?"], "0.00000010000"),
        ([":PULSE0:PER 0.0001", ":PULSE0:PER?"], "0.00010000000"),
    ],
)
def test_bnc575_line_by_line(lines: list[str], reply: str) -> None:
    device = SimulatedBNC575()
    for line in lines[:-1]:
        assert device.feed(line) in ("ok", "ok\r\n") or "ECHO" in line
    assert device.feed(lines[-1]) == reply


def test_bnc575_outputs_follow_triggers_and_links() -> None:
    device = SimulatedBNC575()
    for line in (
        ":PULSE1:STATE 1",
        ":PULSE1:DEL 3e-7",
        ":PULSE2:STATE 1",
        ":PULSE2:SYNC CHA",
        ":PULSE0:TRIG:MOD TRIG",
    ):
        assert device.feed(line) == "ok"
    assert not device.trigger("external rising")
    device.feed(":PULSE0:STATE 1")
    assert device.trigger("external rising")
    rises = {edge.output: edge.time_ps for edge in device.edges if edge.level == 1}
    assert rises == {"A": 300_000, "B": 300_000}


def test_too_long_a_line_is_lost_whole() -> None:
    splitter = CommandSplitter(";\r\n", 255)
    assert splitter.take(b"x" * 300 + b"\n*IDN?;LERR?\r\n") == ["x" * 44, "*IDN?", "LERR?", ""]
    assert splitter.overflowed


def test_there_are_more_than_twenty_faults_and_each_does_something() -> None:
    assert len(FAULTS) >= 20
    for name in FAULTS:
        seen = []
        for start in (False, True):
            faults = Faults(simulated_device("dg645"), seed=3)
            if start:
                faults.start(name, count=-1)
            chunks = [
                faults.run(line)
                for line in (
                    "TLVL?",
                    "DLAY2,0,0.000000300000",
                    "DLAY?2",
                    "LERR?",
                    "TLVL 2",
                    "TLVL?",
                    "DLAY?2",
                )
            ]
            seen.append(repr(chunks))
        assert seen[0] != seen[1], name
    with pytest.raises(ValueError, match="drop-byte"):
        Faults(simulated_device("dg645")).start("nonsense")


def ask(place: tuple[str, int], *lines: str) -> list[str]:
    with (
        socket.create_connection(place, timeout=5) as connection,
        connection.makefile("rw", newline="") as file,
    ):
        answers = []
        for line in lines:
            file.write(f"{line}\n")
            file.flush()
            answers.append(file.readline().strip())
    return answers


def test_raw_sockets_and_the_side_door() -> None:
    with rig.simulate("dg645") as simulated:
        assert simulated.address is not None
        assert ask(simulated.address, "*IDN?", "DLAY?3") == [
            "Stanford Research Systems,DG645,s/n004025,ver1.14.10E",
            "2,+0.000000010000",
        ]
        words = ("fault truncate count=1", "feed TSRC1", "trigger", "edges", "nonsense", "fault x", "help")
        told = [json.loads(one) for one in ask(simulated.side_door, *words)]
        assert told[0]["active"] == ["truncate"]
        assert told[2]["fired"] and len(told[3]["edges"]) == 8
        assert "error" in told[4] and "error" in told[5]
        assert (
            ask(simulated.address, "*IDN?")[0] == "Stanford Research Systems,DG645,s/n004025,ver1.14.10E"[:26]
        )


def test_two_clients_share_one_device() -> None:
    with rig.simulate("dg645") as simulated:
        assert simulated.address is not None
        with socket.create_connection(simulated.address) as first:
            first.sendall(b"TLVL 2.5\n*OPC?\n")
            assert first.recv(10).strip() == b"1"
            assert ask(simulated.address, "TLVL?") == ["+2.50"]


def test_bytes_take_their_time_when_paced() -> None:
    with rig.simulate("dg645", baud=9600) as simulated:
        assert simulated.address is not None
        begin = time.monotonic()
        assert len(ask(simulated.address, "DLAY?2")[0]) == 17
        taken = time.monotonic() - begin
    wire = (len("DLAY?2\n") + len("0,+0.000000000000\r\n")) * 10 / 9600
    assert wire <= taken < wire + 0.25


def test_a_pty_outlives_its_clients_and_its_name_goes_with_it(tmp_path: Path) -> None:
    name = tmp_path / "dg645"
    with rig.simulate("dg645", tcp=None, pty=True, symlink=name) as simulated:
        for _ in range(2):
            with rig.open_generator(str(name), model="dg645", read_only=True) as box:
                assert box.identity.serial == "004025"
        assert os.path.realpath(name) == simulated.pty_name
    assert not name.is_symlink()


def test_a_port_that_is_taken_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(rig.PlanError, match="a free port"):
        rig.simulate(tcp=f"127.0.0.1:{taken.getsockname()[1]}").open()
    with pytest.raises(rig.PlanError, match="HOST:PORT"):
        rig.simulate(tcp="nowhere")
