"""Files and folders are written whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from imclab.errors import InputError, OutputError
from imclab.files import check_folder, folder_written_whole, written_whole


def test_a_file_appears_only_when_the_block_succeeds(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), written_whole(tmp_path / "a.txt") as temporary:
        temporary.write_text("half")
        _ = 1 / 0
    assert list(tmp_path.iterdir()) == []
    with written_whole(tmp_path / "a.txt") as temporary:
        temporary.write_text("whole")
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_a_missing_folder_is_told(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="folder that exists"), written_whole(tmp_path / "no" / "a") as part:
        part.write_text("x")


def test_a_folder_appears_only_when_the_block_succeeds(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), folder_written_whole(tmp_path / "f") as temporary:
        (temporary / "a").write_text("half")
        _ = 1 / 0
    assert list(tmp_path.iterdir()) == []
    with folder_written_whole(tmp_path / "f") as temporary:
        (temporary / "a").write_text("whole")
    assert (tmp_path / "f" / "a").read_text() == "whole"


def test_a_folder_with_something_in_it_is_refused(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("mine")
    with pytest.raises(InputError, match="empty"), folder_written_whole(tmp_path):
        pass
    assert (tmp_path / "kept").read_text() == "mine"


def test_a_folder_below_a_file_is_told_with_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    for place in (tmp_path / "file", tmp_path / "file" / "a" / "b"):
        with pytest.raises(OutputError, match=r"file is a file\). Name a folder"):
            check_folder(place)
    assert check_folder(tmp_path / "new" / "deeper") == tmp_path / "new" / "deeper"
    with pytest.raises(OutputError, match="Name a folder"), folder_written_whole(tmp_path / "file" / "a"):
        pass
