"""The main job, from files to the page, on the experiment that ships: its truth is found again."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile

from imclab.uncertainty import Estimate

ROOT = Path(__file__).parents[2]
TANK = ROOT / "data/experiments/tank"


def start(*words: str | Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "imclab", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )


def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
    process = start(*words)
    out, err = process.communicate(timeout=600)
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The report of the shipped experiment, and what the command printed."""
    folder = tmp_path_factory.mktemp("report") / "report"
    done = run("report", TANK / "experiment.toml", "-o", folder, "--json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


@pytest.fixture(scope="module")
def truth() -> dict[str, Any]:
    return dict(json.loads((TANK / "truth.json").read_text(encoding="utf-8")))


def test_leaves_the_files_it_promises(made: tuple[Path, dict[str, Any]]) -> None:
    folder, printed = made
    assert (folder / "report.html").is_file()
    assert (folder / "figures").is_dir()
    assert {path.stem for path in folder.glob("*.h5")} >= {c["name"] for c in printed["conditions"]}
    numbers = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert numbers["synthetic"] is True
    assert (folder / "report.html").stat().st_size < 3e6
    assert (folder / "comparison.h5").stat().st_size < 5e6


def test_energy_ratios_hold_the_truth_in_their_95_percent_intervals(
    made: tuple[Path, dict[str, Any]], truth: dict[str, Any]
) -> None:
    frames = 8
    for condition in made[1]["conditions"]:
        if condition["name"] == condition["reference"]:
            continue
        energies = [truth["conditions"][condition[key]]["energy_J"] for key in ("name", "reference")]
        measured = Estimate(condition["measured_ratio"], condition["measured_ratio_stderr"], frames - 1)
        low, high = measured.interval
        assert low <= energies[0] / energies[1] <= high, condition["name"]
        # A truth that is 2 % away would be noticed.
        assert not low <= 1.02 * energies[0] / energies[1] <= high, condition["name"]
        assert condition["verdict"] == "agrees within its uncertainty"


def test_the_water_does_to_the_simulation_what_it_does_to_the_measurement(
    made: tuple[Path, dict[str, Any]],
) -> None:
    numbers = json.loads((made[0] / "report.json").read_text(encoding="utf-8"))
    for condition in numbers["conditions"]:
        if condition["is_reference"]:
            continue
        clean, noisy, measured = (
            condition["degradation"][name]["mssim"]["value"]
            for name in ("simulated", "with noise", "measured")
        )
        assert noisy == pytest.approx(measured, abs=0.01), condition["name"]
        assert clean != pytest.approx(measured, abs=0.01), condition["name"]  # noise is what differs


def test_registration_finds_the_mount_within_a_fifth_of_a_pixel(
    made: tuple[Path, dict[str, Any]], truth: dict[str, Any]
) -> None:
    numbers = json.loads((made[0] / "report.json").read_text(encoding="utf-8"))
    corners = np.array([[0, 0, 1], [199, 0, 1], [199, 199, 1], [0, 199, 1]], dtype=float).T
    for condition in numbers["conditions"]:
        found = np.array(condition["registration"]["matrix"]["values"])
        true = np.array(truth["conditions"][condition["name"]]["matrix"])
        assert np.hypot(*(found @ corners - true @ corners)[:2]).max() < 0.2, condition["name"]


def test_gain_steps_are_found_within_two_percent(
    made: tuple[Path, dict[str, Any]], truth: dict[str, Any]
) -> None:
    import calibration

    camera = calibration.load(made[0] / "calibration.h5")
    for setting, ratio in truth["camera"]["relative_gain"].items():
        assert camera.relative_gain(float(setting))[0] == pytest.approx(ratio, rel=0.02)


def test_the_same_command_again_uses_what_is_there(made: tuple[Path, dict[str, Any]]) -> None:
    folder, printed = made
    page = (folder / "report.html").read_bytes()
    done = run("report", TANK / "experiment.toml", "-o", folder, "--json")
    assert "simulating" not in done.stderr
    assert json.loads(done.stdout) == printed
    assert (folder / "report.html").read_bytes() == page


def test_renders_again_from_saved_numbers(made: tuple[Path, dict[str, Any]]) -> None:
    folder, printed = made
    page = (folder / "report.html").read_bytes()
    (folder / "report.html").unlink()
    done = run("report", "--from-saved", folder, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == printed
    assert (folder / "report.html").read_bytes() == page


def test_an_interrupt_keeps_what_is_finished(tmp_path: Path) -> None:
    folder = tmp_path / "report"
    process = start("report", TANK / "experiment.toml", "-o", folder, "--rel-error", "0.00005")
    deadline = time.monotonic() + 300
    while not (folder / "calibration.h5").is_file() and time.monotonic() < deadline:
        time.sleep(0.1)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130, err
    assert "Run the same command to go on" in err
    assert "Traceback" not in err
    assert not list(folder.glob(".*part"))
    assert (folder / "calibration.h5").is_file()


@pytest.fixture
def tank(tmp_path: Path) -> Path:
    """A copy of the experiment that a test may spoil."""
    return Path(shutil.copytree(TANK, tmp_path / "tank"))


def spoil(tank: Path, kind: str) -> None:
    """Make one mistake in the experiment folder."""
    first = tank / "frames/diver-0.42.tif"
    text = (tank / "experiment.toml").read_text(encoding="utf-8")
    if kind == "unknown key":
        (tank / "experiment.toml").write_text(text.replace("reference =", "referense =", 1))
    elif kind == "negative distance":
        scene = (tank / "scene.toml").read_text(encoding="utf-8")
        (tank / "scene.toml").write_text(scene.replace('distance = "1 m"', 'distance = "-1 m"'))
    elif kind == "missing frames":
        first.unlink()
    elif kind == "frames of another size":
        tifffile.imwrite(first, np.random.default_rng(1).integers(90, 900, (50, 60)).astype(np.uint16))
    elif kind == "saturated frames":
        tifffile.imwrite(first, np.full((192, 192), 4095, np.uint16))
    elif kind == "dark frames":
        tifffile.imwrite(first, np.random.default_rng(1).integers(94, 99, (192, 192)).astype(np.uint16))
    elif kind == "gain not calibrated":
        (tank / "experiment.toml").write_text(text.replace("gain = 700.0", "gain = 1700.0", 1))
    elif kind == "empty condition":
        (tank / "experiment.toml").write_text(text.replace('    "frames/diver-0.42.tif",\n', ""))
    elif kind == "mask of the wrong kind":
        (tank / "targets/diver.png").write_text("no picture")
    elif kind == "no calibration":
        shutil.rmtree(tank / "calibration")


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("unknown key", 'Did you mean "reference"'),
        ("negative distance", "target.distance"),
        ("missing frames", "matches no file"),
        ("frames of another size", "192x192"),
        ("saturated frames", "saturated"),
        ("gain not calibrated", "1700"),
        ("empty condition", "frames"),
        ("mask of the wrong kind", "target.mask"),
        ("no calibration", "calibration"),
    ],
)
def test_a_mistake_is_told_before_anything_is_written(tank: Path, kind: str, says: str) -> None:
    spoil(tank, kind)
    done = run("report", tank / "experiment.toml", "-o", tank.parent / "out")
    assert done.returncode == 2, done.stderr
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tank.parent / "out").exists()


def test_frames_without_the_target_are_refused(tank: Path, made: tuple[Path, dict[str, Any]]) -> None:
    spoil(tank, "dark frames")
    shutil.copytree(made[0], tank.parent / "out")  # the pictures need not be simulated again
    done = run("report", tank / "experiment.toml", "-o", tank.parent / "out")
    assert done.returncode == 2
    assert "frames without the target" in done.stderr
    assert "diver-0.42" in done.stderr


def test_a_folder_with_other_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    done = run("report", TANK / "experiment.toml", "-o", tmp_path)
    assert done.returncode == 2
    assert "earlier report" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]
