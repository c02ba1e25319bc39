"""``imclab particles`` as a newcomer runs it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from imclab.cli import run

ASK = ["particles", "--diameter", "3 um", "--index", "1.59", "--path", "1 m"]


def test_prints_the_readings_side_by_side(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*ASK, "--optical-depth", "0.42"]) == 0
    told = capsys.readouterr().out
    for word in ("absolute index, diameter", "relative index, radius", "grams per litre", "number density"):
        assert word in told
    assert "lottery" in told


def test_json_and_plot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plot = tmp_path / "phase.png"
    assert run([*ASK, "--concentration", "1 mg/l", "--water", "none", "--json", "-o", str(plot)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["reading"] == "absolute index, diameter"
    assert told["attenuation_per_m"] == pytest.approx(0.397, abs=0.02)
    assert told["grams_per_litre"] == pytest.approx(1e-3)
    assert len(told["readings"]) == 4
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in tmp_path.iterdir()] == ["phase.png"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--diameter", "3", "--index", "1.59", "--optical-depth", "1"], "--diameter"),
        (["--diameter", "3 kg", "--index", "1.59", "--optical-depth", "1"], "--diameter"),
        (["--diameter", "3 um", "--index", "glass", "--optical-depth", "1"], "--index"),
        (["--diameter", "3 um", "--index", "1.59"], "exactly one of --optical-depth"),
        (["--diameter", "3 um", "--index", "1.59", "--optical-depth", "0.01"], "the water's own"),
        (["--diameter", "3 um", "--index", "1.59", "--optical-depth", "1", "-o", "a.doc"], "--output"),
        (["--diameter", "3 um", "--index", "1.59", "--optical-depth", "1", "-o", "no/a.png"], "no/a.png"),
        (
            ["--diameter", "3 um", "--index", "1.59", "--optical-depth", "1", "--wavelength", "2 um"],
            "wavelength",
        ),
    ],
)
def test_bad_input_is_told_in_one_block(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["particles", *arguments]) == 2
    told = capsys.readouterr()
    assert said in told.err
    assert told.out == ""
    assert "Traceback" not in told.err


def test_optics_stays_light_until_it_is_used() -> None:
    heavy = "{'numba', 'scipy', 'matplotlib'}"
    code = f"import sys, imclab; imclab.optics.phase; print(*(set(sys.modules) & {heavy}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
