"""`imclab simulate` and `imclab transmit` from file to file."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import imclab
from imclab.cli import run
from imclab.result import Flux, Result

ROOT = Path(__file__).parents[2]
SLIT = ROOT / "data" / "scenes" / "lambertian_slit.toml"
ONE_WAY = ROOT / "data" / "scenes" / "jerlov_one_way.toml"


def told(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    return dict(json.loads(capsys.readouterr().out))


def test_simulate_writes_the_picture_with_its_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "r.h5"
    code = run(
        ["simulate", str(SLIT), "-o", str(output), "--packets", "2e5", "--estimator", "analog", "--json"]
    )
    assert code == 0
    summary, result = told(capsys), Result.load(output)
    assert summary["packets"] == result.packets == 200_000
    assert result.energy.shape == (200, 200)
    assert result.total == pytest.approx(result.energy.sum(), rel=1e-9)
    np.testing.assert_allclose(result.energy, result.target + result.backscatter, rtol=1e-12)
    assert result.time_edges is not None
    assert result.time_energy is not None
    assert result.time_energy.size == result.time_edges.size - 1
    assert result.estimator == "analog"


def test_threads_and_repetition_give_the_same_bits() -> None:
    scene = imclab.load_scene(SLIT).with_(**{"receiver.aperture_radius": "20 cm"})
    options: dict[str, Any] = {"packets": 1e5, "seed": 3, "estimator": "analog"}
    one, two = (imclab.simulate(scene, threads=threads, **options) for threads in (1, 2))
    assert one.energy.tobytes() == two.energy.tobytes()
    assert one.energy_stderr.tobytes() == two.energy_stderr.tobytes()
    other = imclab.simulate(scene, **(options | {"seed": 4}))
    assert other.energy.tobytes() != one.energy.tobytes()
    first, second = (imclab.transmit(scene, packets=2e5, threads=threads, seed=3) for threads in (1, 2))
    assert first.transmitted.tobytes() == second.transmitted.tobytes()
    assert first.spot_fwhm_stderr.tobytes() == second.spot_fwhm_stderr.tobytes()


def test_transmit_writes_every_plane(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "f.h5"
    code = run(
        ["transmit", str(ONE_WAY), "-o", str(output), "--distances", "2 m, 1 m", "--packets", "1e5", "--json"]
    )
    assert code == 0
    summary, flux = told(capsys), Flux.load(output)
    assert flux.distances.tolist() == summary["distances"] == [1.0, 2.0]
    assert (np.diff(flux.transmitted) < 0.0).all()
    assert (np.diff(flux.reflected) > 0.0).all()
    assert flux.transmitted[-1] + flux.reflected[-1] + flux.absorbed == pytest.approx(1.0, abs=1e-6)
    assert (flux.spot_fwhm_stderr < 0.02 * flux.spot_fwhm).all()
    assert (flux.pulse_fwhm >= 4.5e-9).all()


def test_a_relative_error_is_reached() -> None:
    flux = imclab.transmit(imclab.load_scene(ONE_WAY), rel_error=0.01, seed=1)
    assert flux.reflected_stderr[0] / flux.reflected[0] <= 0.0101
    assert flux.transmitted_stderr[0] / flux.transmitted[0] <= 0.01


@pytest.mark.parametrize(
    ("words", "told_words"),
    [
        (["simulate", str(SLIT), "-o", "x.h5", "--packets", "-3"], "'--packets': got -3; wanted"),
        (["simulate", str(SLIT), "-o", "x.h5", "--packets", "nan"], "'--packets': got nan; wanted"),
        (["simulate", str(SLIT), "-o", "x.h5", "--seconds", "0"], "'--seconds': got 0; wanted"),
        (["simulate", str(SLIT), "-o", "x.h5", "--seed", "-1"], "'--seed': got -1; wanted"),
        (["transmit", str(ONE_WAY), "-o", "x.h5", "--rel-error", "2"], "'--rel-error': got 2; wanted"),
        (["simulate", str(SLIT), "-o", "x.h5", "--estimator", "best"], "estimator"),
        (["simulate", str(SLIT), "-o", "x.h5", "--threads", "0"], "'--threads': got 0; wanted"),
        (["simulate", "none.toml", "-o", "x.h5"], "none.toml"),
        (["transmit", str(ONE_WAY), "-o", "x.h5", "--distances", "3 kg"], "distances"),
        (["transmit", str(ONE_WAY), "-o", "x.h5", "--distances", "-1 m", "--packets", "10"], "distances"),
    ],
)
def test_what_the_user_can_mend_is_told_without_a_traceback(
    words: list[str],
    told_words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(words) == 2
    assert told_words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_and_kill_save_what_was_finished(number: int, tmp_path: Path) -> None:
    output = tmp_path / "r.h5"
    command = [sys.executable, "-m", "imclab", "simulate", str(SLIT), "-o", str(output)]
    process = subprocess.Popen(
        [*command, "--seconds", "100", "--estimator", "analog", "--threads", "1"],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
        text=True,
    )
    assert process.stderr is not None
    while "packets" not in process.stderr.readline():
        pass  # until the first line of progress: batches are being finished
    time.sleep(0.3)
    process.send_signal(number)
    _, rest = process.communicate(timeout=60)
    assert process.returncode == 130, rest
    result = Result.load(output)
    assert result.interrupted
    assert result.packets > 0
    assert "Traceback" not in rest


def test_a_run_stops_at_the_error_of_the_median_pixel(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The total's error is far smaller; asking for both at once is refused."""
    command = ["simulate", str(SLIT), "-o", str(tmp_path / "r.h5"), "--pixel-error", "0.004", "--json"]
    assert run(command) == 0
    summary = told(capsys)
    assert summary["pixel_error"] <= 0.004
    assert summary["relative_error"] < 0.2 * summary["pixel_error"]
    assert summary["pixel_error"] == Result.load(tmp_path / "r.h5").pixel_error
    assert run([*command, "--rel-error", "0.01"]) == 2
    assert "only one" in capsys.readouterr().err
