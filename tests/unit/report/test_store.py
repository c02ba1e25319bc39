from __future__ import annotations

from pathlib import Path

import pytest

from imclab.errors import InputError
from imclab.report.store import Store


def write(text: str):
    return lambda path: path.write_text(text, encoding="utf-8")


def test_files_of_the_same_experiment_are_found_again(tmp_path: Path) -> None:
    Store(tmp_path / "r", "tank").keep("a.h5", "key", write("a"))
    again = Store(tmp_path / "r", "tank")
    assert again.holds("a.h5", "key")
    assert not again.holds("a.h5", "other key")
    Store(tmp_path / "r", "tank").forget_unused()
    assert not (tmp_path / "r" / "a.h5").exists()


def test_the_report_of_another_experiment_is_not_written_over(tmp_path: Path) -> None:
    Store(tmp_path / "r", "tank").keep("a.h5", "key", write("a"))
    with pytest.raises(InputError, match='the report of "tank"'):
        Store(tmp_path / "r", "pool")
    assert (tmp_path / "r" / "a.h5").read_text(encoding="utf-8") == "a"
