"""A comparison as one HDF5 file, from which the report is rendered again without any simulation.

Records are stored by their own fields: an array is a dataset, a record or a table of records a group,
anything else a text in JSON. A field that a record gains later is stored without a change here.
"""

from __future__ import annotations

import json
import types
import typing
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from imclab.comparison import Comparison
from imclab.errors import Fault, InputError
from imclab.files import written_whole
from imclab.report.context import Context
from imclab.result import open_result

FILE_NAME = "comparison.h5"
_SCHEMA = 1


def save(comparison: Comparison, context: Context, folder: str | Path) -> Path:
    """Write ``folder``/comparison.h5, whole or not at all; return its path.

    Raises
    ------
    OutputError
        When the folder does not exist or may not be written to.
    """
    import h5py

    path = Path(folder) / FILE_NAME
    with written_whole(path) as temporary, h5py.File(temporary, "w", track_order=True) as file:
        file.attrs["report_schema"] = _SCHEMA
        _write(file, "comparison", comparison)
        _write(file, "context", context)
    return path


def load(folder: str | Path) -> tuple[Comparison, Context]:
    """Read what `save` wrote.

    Raises
    ------
    InputError
        When there is no such file or it is not one of these.
    """
    path = Path(folder) / FILE_NAME
    with open_result(path, "comparison") as file:
        schema = int(file.attrs.get("report_schema", 0))
        if schema != _SCHEMA:
            advice = "Make the report again from the experiment."
            raise InputError(str(path), [Fault("report_schema", str(schema), str(_SCHEMA), advice)])
        try:
            return _read(file["comparison"], Comparison), _read(file["context"], Context)
        except (KeyError, TypeError, ValueError) as error:
            advice = "Make the report again from the experiment."
            fault = Fault("comparison", f"a damaged record ({error})", "what `imclab report` saves", advice)
            raise InputError(str(path), [fault]) from error


def _write(group: Any, name: str, value: Any) -> None:
    if isinstance(value, np.ndarray):
        packed = {"compression": "gzip", "shuffle": True} if value.size > 64 else {}
        group.create_dataset(name, data=value, **packed)
    elif is_dataclass(value):
        inner = group.create_group(name, track_order=True)
        for item in fields(value):
            _write(inner, item.name, getattr(value, item.name))
    elif isinstance(value, Mapping):
        inner = group.create_group(name, track_order=True)
        for key, entry in value.items():
            _write(inner, _escaped(key), entry)
    elif isinstance(value, tuple) and value and not isinstance(value[0], (str, int, float)):
        inner = group.create_group(name, track_order=True)
        for index, entry in enumerate(value):
            _write(inner, str(index), entry)
    else:
        group[name] = json.dumps(value, default=lambda number: number.item())


def _escaped(key: str) -> str:
    """HDF5 reads a slash in a name as a path."""
    return key.replace("%", "%25").replace("/", "%2F")


def _plain(key: str) -> str:
    return key.replace("%2F", "/").replace("%25", "%")


def _read(member: Any, wanted: Any) -> Any:
    """Return what ``member`` holds, a dataset or a group, as type ``wanted``."""
    if hasattr(member, "shape"):
        return _read_dataset(member, wanted)
    if typing.get_origin(wanted) in (typing.Union, types.UnionType):
        wanted = next(kind for kind in typing.get_args(wanted) if kind is not types.NoneType)
    if is_dataclass(wanted):
        hints = typing.get_type_hints(wanted)
        known = [item.name for item in fields(wanted) if item.init and item.name in member]
        return typing.cast(Any, wanted)(**{name: _read(member[name], hints[name]) for name in known})
    kinds = typing.get_args(wanted)
    if typing.get_origin(wanted) is tuple:
        kinds = kinds[:1] * len(member) if kinds[-1] is Ellipsis else kinds
        return tuple(_read(member[str(index)], kinds[index]) for index in range(len(member)))
    return {_plain(name): _read(member[name], kinds[-1]) for name in member}


def _read_dataset(dataset: Any, wanted: Any) -> Any:
    if dataset.dtype.kind == "O":
        value = json.loads(dataset.asstr()[()])
        if not isinstance(value, list):
            return value
        return wanted(*value) if hasattr(wanted, "_fields") else tuple(value)
    array = dataset[()]
    array.setflags(write=False)
    return array
