"""``imclab study`` as it is typed: figure, table and verdicts; again without work; faults told."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from imclab.cli import run

ROOT = Path(__file__).parents[2]
STUDY = f"""
schema = 1
title = "Small"
shows = "Fig. 8"
kind = "energy"
scene = "{ROOT}/data/scenes/lambertian_slit.toml"
[run]
packets = 2e3
[vary]
key = "medium.attenuation"
values = "0.42 1/m, 1.42 1/m"
label = "optical depth"
[[curve]]
name = "slit, coaxial"
changes = {{ "receiver.pixels" = [5, 5] }}
[[curve]]
name = "slit, 20 cm aside"
changes = {{ "receiver.pixels" = [5, 5], "receiver.position" = ["20 cm", "0 m", "0 m"] }}
"""


def test_a_study_writes_figure_table_and_verdicts_and_resumes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "small.toml").write_text(STUDY, encoding="utf-8")
    words = ["study", str(tmp_path / "small.toml"), "-o", str(tmp_path / "out"), "--workers", "1"]
    assert run(words) == 0
    assert "true   Fig. 8: The energy falls with optical depth." in capsys.readouterr().out
    folder = tmp_path / "out" / "small"
    assert (folder / "figure.png").read_bytes().startswith(b"\x89PNG")
    with (folder / "results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["curve"] for row in rows] == ["slit, coaxial"] * 2 + ["slit, 20 cm aside"] * 2
    assert "**True**: The energy falls" in (folder / "study.md").read_text(encoding="utf-8")
    assert run([*words, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)["studies"]["small"]
    assert summary == json.loads((folder / "study.json").read_text(encoding="utf-8"))
    assert json.loads((folder / "sweep.json").read_text(encoding="utf-8"))["resumed"] == 4


def test_what_is_wrong_with_a_study_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["study", "-o", str(tmp_path / "out")]) == 2
    assert "wanted study files, or --all" in capsys.readouterr().err
    (tmp_path / "bad.toml").write_text(STUDY.replace("values", "valuse"), encoding="utf-8")
    assert run(["study", str(tmp_path / "bad.toml"), "-o", str(tmp_path / "out")]) == 2
    assert 'Did you mean "values"' in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
