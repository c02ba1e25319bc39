from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from imclab.errors import InputError, OutputError
from imclab.report import load, save
from tests.unit.report import made_up


def assert_same(left: Any, right: Any, where: str = "") -> None:
    assert type(left) is type(right), where
    if dataclasses.is_dataclass(left):
        for item in dataclasses.fields(left):
            assert_same(getattr(left, item.name), getattr(right, item.name), f"{where}.{item.name}")
    elif isinstance(left, np.ndarray):
        assert left.dtype == right.dtype, where
        np.testing.assert_array_equal(left, right, err_msg=where)
    elif isinstance(left, dict):
        assert list(left) == list(right), where
        for key in left:
            assert_same(left[key], right[key], f"{where}[{key}]")
    elif isinstance(left, tuple):
        assert len(left) == len(right), where
        for index, pair in enumerate(zip(left, right, strict=True)):
            assert_same(*pair, f"{where}[{index}]")
    else:
        assert left == right or (left != left and right != right), where


def test_what_is_saved_is_loaded_to_the_last_bit(tmp_path: Path) -> None:
    made, context = made_up.comparison(size=48), made_up.context()
    save(made, context, tmp_path)
    loaded, its_context = load(tmp_path)
    assert_same(loaded, made)
    assert_same(its_context, context)


def test_values_that_files_find_hard_survive(tmp_path: Path) -> None:
    made = made_up.comparison(size=48)
    first = made.outcomes[1]
    odd = dataclasses.replace(
        first,
        metrics={"psnr": dataclasses.replace(first.metrics["psnr"], value=np.inf)},
        error=dataclasses.replace(first.error, budget={"medium/odd key": 0.01, "50 %": 0.0}),
        pair=dataclasses.replace(
            first.pair, result=dataclasses.replace(first.pair.result, time_edges=None, notes=())
        ),
    )
    save(dataclasses.replace(made, outcomes=(odd,)), made_up.context(), tmp_path)
    loaded = load(tmp_path)[0].outcomes[0]
    assert_same(loaded, odd)


def test_loaded_arrays_are_read_only(tmp_path: Path) -> None:
    save(made_up.comparison(size=48), made_up.context(), tmp_path)
    loaded, _ = load(tmp_path)
    assert not loaded.outcomes[0].pair.measured.flags.writeable


def test_a_folder_without_a_report_is_told_apart(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load(tmp_path)
    (tmp_path / "comparison.h5").write_bytes(b"no HDF5")
    with pytest.raises(InputError, match="no HDF5"):
        load(tmp_path)
    with h5py.File(tmp_path / "comparison.h5", "w") as file:
        file.attrs["report_schema"] = 1
        file.create_group("comparison")
        file.create_group("context")
    with pytest.raises(InputError, match="damaged"):
        load(tmp_path)
    with h5py.File(tmp_path / "comparison.h5", "a") as file:
        file.attrs["report_schema"] = 99
    with pytest.raises(InputError, match="report_schema: got 99"):
        load(tmp_path)


def test_nothing_is_left_behind_when_the_folder_is_missing(tmp_path: Path) -> None:
    with pytest.raises(OutputError):
        save(made_up.comparison(size=48), made_up.context(), tmp_path / "missing")
    assert list(tmp_path.iterdir()) == []
