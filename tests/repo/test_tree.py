"""The tree itself: commands that the README names, sizes, and words that do not belong here."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]


def files() -> list[Path]:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    return [ROOT / name for name in listed.stdout.split("\0") if name]


def test_continuous_integration_runs_the_tests_as_the_readme_does() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    command = 'python -m pip install -e ".[test]"'
    assert command in readme
    assert command in (ROOT / ".ci/run").read_text(encoding="utf-8")


def test_no_module_is_longer_than_350_lines() -> None:
    for path in files():
        if path.suffix == ".py" and path.parts[len(ROOT.parts)] in ("imclab", "rig", "calibration"):
            assert len(path.read_text(encoding="utf-8").splitlines()) <= 350, path


def test_no_path_of_a_machine_in_the_tree() -> None:
    pattern = re.compile(r"(?<![\w.-])/(home|root|work|Users)/")
    for path in files():
        if path.suffix in (".py", ".md", ".toml", ".csv", ".json", ".cff"):
            assert not pattern.search(path.read_text(encoding="utf-8")), path


def test_data_stays_under_twenty_megabytes() -> None:
    assert sum(path.stat().st_size for path in files() if path.is_relative_to(ROOT / "data")) < 20e6
