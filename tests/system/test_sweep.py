"""``imclab sweep`` as it is typed: killed, resumed, spread over workers and over a Dask cluster."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from imclab.cli import run

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "data/scenes/lambertian_slit.toml"
QUICK = ["--packets", "2e4", "--set", "receiver.pixels=[10, 10]"]


def command(*words: str | Path) -> list[str]:
    return [sys.executable, "-m", "imclab", "sweep", *map(str, words)]


def sweep(*words: str | Path, code: int = 0) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(command(*words), capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "table.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def pictures(folder: Path) -> list[bytes]:
    found = []
    for row in table(folder):
        with h5py.File(folder / row["file"]) as file:
            found.append(
                np.asarray(file["image/energy"]).tobytes() + np.asarray(file["image/stderr"]).tobytes()
            )
    return found


def seeds(count: int) -> list[str]:
    return ["--set", f"run.seed=1 to {count} in {count}"]


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("uninterrupted") / "out"
    sweep(SCENE, *QUICK, *seeds(24), "-o", folder, "--workers", "1")
    return folder


def children(parent: int) -> list[int]:
    """The worker processes of a sweep (but not the tracker of resources that Python starts beside them)."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = status.read_text().rpartition(")")[2].split()
            words = (status.parent / "cmdline").read_text()
            if int(fields[1]) == parent and "spawn_main" in words:
                found.append(int(status.parent.name))
    return found


def wait_until(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.02)


def test_killed_worker_then_killed_whole_then_resumed_gives_equal_bits(
    tmp_path: Path, uninterrupted: Path
) -> None:
    words = command(SCENE, *QUICK, *seeds(24), "-o", tmp_path, "--workers", "2")
    units = tmp_path / "units"
    with subprocess.Popen(words, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        wait_until(lambda: len(list(units.glob("*.h5"))) >= 3)
        first = children(process.pid)
        os.kill(first[0], signal.SIGKILL)
        wait_until(lambda: bool(set(children(process.pid)) - set(first)))
        process.kill()
    finished = len(list(units.glob("*.h5")))
    assert 3 <= finished < 24, "the kill came too late to mean anything"
    wait_until(lambda: not any(Path(f"/proc/{worker}").exists() for worker in first))
    done = sweep(SCENE, *QUICK, *seeds(24), "-o", tmp_path, "--workers", "2", "--json")
    assert json.loads(done.stdout)["resumed"] >= finished
    assert (tmp_path / "table.csv").read_bytes() == (uninterrupted / "table.csv").read_bytes()
    assert pictures(tmp_path) == pictures(uninterrupted)
    assert not list(units.glob(".*.part")), "a killed run leaves no half file behind"


def test_four_workers_give_equal_bits(tmp_path: Path, uninterrupted: Path) -> None:
    sweep(SCENE, *QUICK, *seeds(24), "-o", tmp_path, "--workers", "4")
    assert pictures(tmp_path) == pictures(uninterrupted)


def test_another_seed_gives_other_bits(uninterrupted: Path) -> None:
    assert len(set(pictures(uninterrupted))) > 1


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", processes=True
    ) as cluster:
        yield cluster.scheduler_address


def test_a_cluster_gives_equal_bits(tmp_path: Path, uninterrupted: Path, scheduler: str) -> None:
    sweep(SCENE, *QUICK, *seeds(24), "-o", tmp_path, "--dask", scheduler)
    assert pictures(tmp_path) == pictures(uninterrupted)


def test_nobody_at_the_scheduler_is_told_kindly(tmp_path: Path) -> None:
    done = sweep(SCENE, *QUICK, *seeds(2), "-o", tmp_path, "--dask", "tcp://127.0.0.1:9", code=2)
    assert "no scheduler answers" in done.stderr


def test_an_interruption_ends_with_130_and_keeps_the_table(tmp_path: Path) -> None:
    words = command(SCENE, *QUICK, *seeds(24), "-o", tmp_path, "--workers", "2")
    with subprocess.Popen(
        words, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        wait_until(lambda: len(list((tmp_path / "units").glob("*.h5"))) >= 2)
        process.send_signal(signal.SIGINT)
        told = process.communicate()[1]
    assert process.returncode == 130, told
    assert "The same command continues" in told
    assert 1 <= len(table(tmp_path)) < 24


def test_a_bad_value_among_good_ones_is_listed_and_the_rest_finished(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["sweep", str(SCENE), *QUICK, "--set", "medium.albedo=0.5,1.5", "-o", str(tmp_path)]
    assert run(words) == 2
    assert "unit 1 (receiver.pixels = [10, 10], medium.albedo = 1.5)" in capsys.readouterr().err
    assert [row["status"] for row in table(tmp_path)] == ["done", "failed"]


def test_a_wrong_key_is_told_before_anything_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["sweep", str(SCENE), "--set", "medium.albdo=0.5", "-o", str(tmp_path / "out")]) == 2
    assert 'Did you mean "albedo"' in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_without_a_key_to_vary_one_is_told_of_simulate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["sweep", str(SCENE), "-o", str(tmp_path / "out")]) == 2
    assert "For one scene: imclab simulate" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_without_the_cluster_extra_one_is_told_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "distributed.py").write_text("raise ImportError('not here')\n")
    words = command(SCENE, *QUICK, *seeds(2), "-o", tmp_path / "out", "--dask", "tcp://127.0.0.1:9")
    environment = os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path, env=environment, check=False)
    assert done.returncode == 2
    assert 'pip install "imclab[cluster]"' in done.stderr
