"""The command line as a whole: help, exit codes, and one clear block for what is wrong."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import imclab

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "data/scenes/tank.toml"
EXPERIMENT = ROOT / "data/experiments/tank/experiment.toml"


def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """Run ``imclab`` as a user does."""
    return subprocess.run(
        [sys.executable, "-m", "imclab", *map(str, words)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
        timeout=120,
    )


def test_help_and_version() -> None:
    assert "report" in run("--help").stdout
    assert run("--version").stdout.strip() == f"imclab {imclab.__version__}"


def test_without_words_it_shows_its_help_and_nothing_else() -> None:
    done = run()
    assert "report" in done.stdout + done.stderr
    assert "imclab: \n" not in done.stderr


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["simulat"], "simulat"),
        (["twin", "none.toml", "-o", "out"], "none.toml"),
        (["twin", SCENE, "-o", "out", "--optical-depths", "a,b"], "optical-depths"),
        (["twin", SCENE, "-o", "out", "--mask", "none.png"], "none.png"),
        (["report", EXPERIMENT, "-o", SCENE / "below"], "is a file). Name a folder in one that exists"),
    ],
)
def test_a_mistake_is_told_in_one_block_and_leaves_nothing(
    tmp_path: Path, words: list[str | Path], says: str
) -> None:
    # The package is imported from the checkout, whatever folder the command runs in.
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            f"import sys; sys.path.insert(0, {str(ROOT)!r}); import imclab.cli as c; c.main()",
        ]
        + [str(word) for word in words],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
        timeout=120,
    )
    assert done.returncode == 2, done.stderr
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []
