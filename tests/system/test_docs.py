"""The documentation does what it says: every command and every Python block on its pages runs."""

from __future__ import annotations

import contextlib
import importlib
import os
import re
import shlex
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from imclab.cli import app, run

ROOT = Path(__file__).parents[2]
PAGES = sorted([*(ROOT / "docs").glob("*.md"), *(ROOT / "docs/how-to").glob("*.md")])
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
FILE_NAME = re.compile(r"# ([\w.-]+\.toml)\n")


def blocks(page: Path) -> list[tuple[str, str]]:
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def commands(block: str) -> list[str]:
    return [line.removeprefix("$ ") for line in block.splitlines() if line.startswith("$ ")]


RUNNABLE = [ROOT / "docs/tutorial.md", *sorted((ROOT / "docs/how-to").glob("*.md"))]
"""Pages that promise to run as they stand, in one folder, the tutorial first."""


@contextlib.contextmanager
def in_background() -> Iterator[list[subprocess.Popen[bytes]]]:
    """Processes that a page starts with ``&``; each has a group of its own, ended with its children."""
    started: list[subprocess.Popen[bytes]] = []
    try:
        yield started
    finally:
        for process in started:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("docs")
    (made / "data").symlink_to(ROOT / "data")
    return made


@pytest.mark.parametrize("page", RUNNABLE, ids=lambda page: page.stem)
def test_every_command_on_the_page_runs(
    page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    with in_background() as background:
        for kind, text in blocks(page):
            if kind == "toml" and (named := FILE_NAME.match(text)):
                Path(named[1]).write_text(text, encoding="utf-8")
            elif kind == "python":
                exec(compile(text, page.name, "exec"), {"__name__": "__main__"})
            elif kind == "console":
                for command in commands(text):
                    _run(command, background, capsys)


def _run(command: str, background: list[subprocess.Popen[bytes]], capsys: pytest.CaptureFixture[str]) -> None:
    if command.endswith(" &"):
        words = shlex.split(command.removesuffix(" &"))
        background.append(
            subprocess.Popen(
                words, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
        )
        return
    program, *arguments = shlex.split(command)
    assert program == "imclab", f"not a command of this project: {command}"
    code = run(arguments)
    assert code == 0, f"{command}\n{capsys.readouterr().err}"


def options_of(words: list[str]) -> tuple[set[str], list[str]]:
    """The options that a command knows, and what is left of its words behind the verbs."""
    command: Any = typer.main.get_command(app)
    while words and words[0] in getattr(command, "commands", {}):
        command, words = command.commands[words[0]], words[1:]
    assert not hasattr(command, "commands"), f"no such verb: {words[:1]}"
    return {name for option in command.params for name in option.opts} | {"--help", "-h"}, words


def test_every_command_on_every_page_names_a_verb_and_options_that_exist() -> None:
    seen = 0
    for page in PAGES:
        for _, text in BLOCK.findall(page.read_text(encoding="utf-8")):
            for line in text.splitlines():
                if re.match(r"(\$ )?imclab \S", line):
                    known, words = options_of(shlex.split(line.removeprefix("$ "), comments=True)[1:])
                    used = {word for word in words if re.match(r"--?[a-z]", word)}
                    assert used <= known, f"{page.name}: {line}"
                    seen += 1
    assert seen > 15


def test_a_verb_or_an_option_that_does_not_exist_is_noticed() -> None:
    with pytest.raises(AssertionError, match="no such verb"):
        options_of(["gate", "plann"])
    assert "--distanc" not in options_of(["gate", "plan"])[0]


def test_links_between_pages_lead_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_every_name_in_the_theory_exists() -> None:
    names = set(re.findall(r"`(imclab(?:\.\w+)+)`", (ROOT / "docs/theory.md").read_text(encoding="utf-8")))
    assert len(names) > 15
    for name in names:
        _resolve(name)


def test_a_name_that_does_not_exist_is_noticed() -> None:
    with pytest.raises(AttributeError):
        _resolve("imclab.optics.mie.efficiency")


def _resolve(name: str) -> object:
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        with contextlib.suppress(ModuleNotFoundError):
            found: object = importlib.import_module(".".join(parts[:length]))
            for attribute in parts[length:]:
                found = getattr(found, attribute)
            return found
    raise ModuleNotFoundError(name)
