"""What a sweep brings: records, failures, and the one table of both."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from imclab.errors import ImclabError
from imclab.files import written_whole
from imclab.result import Flux, Result
from imclab.scene import Scene
from imclab.sweep.units import Refused, Unit

_PICTURE_COLUMNS = ("total", "target_total", "backscatter_total")
_PLANE_COLUMNS = ("transmitted", "reflected", "spot_fwhm", "spot_rms", "pulse_fwhm", "pulse_rms", "mean_path")

Row = dict[str, Any]


class SweepFailedError(ImclabError, RuntimeError):
    """Some units failed; the others are finished and saved."""

    def __init__(self, failures: Sequence[Refused], finished: int) -> None:
        lines = [f"  unit {f.index} ({_words(f.changes)}): {f.reason}" for f in failures]
        super().__init__("\n".join([f"{len(failures)} failed, {finished} finished and saved", *lines]))


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """A sweep as far as it came.

    Attributes
    ----------
    units : tuple of Unit
        Every unit that could be run, finished or not.
    records : mapping of Result or Flux
        What is finished, by the unit's index.
    failures : tuple of Refused
        What failed or made no scene, and why.
    resumed : int
        How many records were found finished.
    interrupted : bool
    other_units : int
        How many results of other sweeps the folder holds; they are kept, but not in the tables.
    """

    units: tuple[Unit, ...]
    records: Mapping[int, Result | Flux]
    failures: tuple[Refused, ...] = ()
    resumed: int = 0
    interrupted: bool = False
    other_units: int = 0

    @property
    def cpu_seconds(self) -> float:
        """Seconds of CPU that the records took, whenever they were made."""
        return sum(record.cpu_seconds for record in self.records.values())

    def rows(self) -> list[Row]:
        """Return the table: one row a picture or a plane, in SI units, failures among them.

        How long a unit took stands in its own file, not here: the table is the same for any number
        of workers and any number of interruptions.
        """
        failures = {failure.index: failure for failure in self.failures}
        by_index = {unit.index: unit for unit in self.units}
        known = {
            (key, _cell(value)): si_value(unit.scene, key, value)
            for unit in self.units
            for key, value in unit.changes.items()
        }
        rows: list[Row] = []
        for index in sorted(by_index.keys() | failures.keys()):
            if index in failures:
                failure = failures[index]
                swept = {key: known.get((key, _cell(v)), _cell(v)) for key, v in failure.changes.items()}
                rows.append({"unit": index} | swept | {"status": "failed", "error": failure.reason})
            elif index in self.records:
                unit, record = by_index[index], self.records[index]
                swept = {key: known[key, _cell(value)] for key, value in unit.changes.items()}
                kept = {"seed": record.seed, "packets": record.packets, "file": f"units/{unit.key}.h5"}
                head = {"unit": index} | swept | {"status": "done"}
                rows += [head | body | kept for body in _measured(record)]
        return _same_columns(rows)

    def save(self, folder: Path) -> None:
        """Write ``table.csv``, ``table.h5`` and ``sweep.json`` into the folder, each whole or not at all."""
        rows = self.rows()
        with written_whole(folder / "table.csv") as temporary, temporary.open("w", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=list(rows[0]) if rows else ["unit"])
            writer.writeheader()
            writer.writerows(rows)
        _save_hdf5(rows, folder / "table.h5")
        with written_whole(folder / "sweep.json") as temporary:
            temporary.write_text(json.dumps(self.summary(), indent=2) + "\n", encoding="utf-8")

    def summary(self) -> dict[str, Any]:
        """Return counts, failures and time, as JSON can hold them."""
        return {
            "units": len(self.units)
            + sum(f.index not in {u.index for u in self.units} for f in self.failures),
            "finished": len(self.records),
            "resumed": self.resumed,
            "interrupted": self.interrupted,
            "other_units": self.other_units,
            "cpu_seconds": self.cpu_seconds,
            "failed": [
                {"unit": f.index, "changes": dict(f.changes), "error": f.reason} for f in self.failures
            ],
        }


def si_value(scene: Scene, key: str, value: Any) -> Any:
    """Return what ``key`` is in the checked scene when that is a number (SI), else ``value`` as text."""
    place: Any = scene
    for name in key.split("."):
        place = getattr(place, name, None)
    number = isinstance(place, (int, float)) and not isinstance(place, bool)
    return place if number else _cell(value)


def _cell(value: Any) -> Any:
    if value is None:
        return "none"
    return value if isinstance(value, (str, int, float)) else json.dumps(value)


def _words(changes: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} = {_cell(value)}" for key, value in changes.items()) or "no changes"


def _measured(record: Result | Flux) -> list[Row]:
    if isinstance(record, Flux):
        names = [name for part in _PLANE_COLUMNS for name in (part, f"{part}_stderr")]
        return [
            {"distance": float(distance)} | {name: float(getattr(record, name)[plane]) for name in names}
            for plane, distance in enumerate(record.distances)
        ]
    names = [name for part in _PICTURE_COLUMNS for name in (part, f"{part}_stderr")]
    row: Row = {name: float(getattr(record, name)) for name in names}
    return [row | {"estimator": record.estimator}]


def _same_columns(rows: list[Row]) -> list[Row]:
    """Give every row every column, in the order of the longest row, ``error`` last."""
    columns = list(dict.fromkeys(name for row in sorted(rows, key=len, reverse=True) for name in row))
    columns.sort(key=lambda name: name == "error")
    return [{name: row.get(name, "") for name in columns} for row in rows]


def _save_hdf5(rows: list[Row], path: Path) -> None:
    import h5py

    with written_whole(path) as temporary, h5py.File(temporary, "w", track_order=True) as file:
        for name in rows[0] if rows else ():
            cells = [row[name] for row in rows]
            if any(isinstance(cell, float) for cell in cells):
                numeric = [cell if isinstance(cell, (int, float)) else np.nan for cell in cells]
                file[f"table/{name}"] = np.array(numeric, dtype=float)
            elif all(isinstance(cell, int) for cell in cells):
                file[f"table/{name}"] = np.array(cells)
            else:
                file.create_dataset(
                    f"table/{name}", data=[str(cell) for cell in cells], dtype=h5py.string_dtype()
                )
