"""A calibration folder: its table (or its file names) checked whole before any picture is used.

All faults of a folder are told together, each with the row of ``frames.csv`` or the file.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from calibration import frames
from calibration.errors import Fault, FolderError, nearest
from calibration.setup import Setup, read_setup

KINDS = ("dark", "flat", "response", "gain")
COLUMNS = ("file", "kind", "energy_J", "energy_rel", "gain", "gate_ns", "level")
TABLE = "frames.csv"
SETUP = "camera.toml"


@dataclass(frozen=True)
class Row:
    """One file of frames taken at one light level and one setting.

    ``energy`` is NaN when it is not known, ``gain`` is NaN for dark frames that hold at any setting;
    ``level`` names an unknown light level that several rows share.
    """

    where: str
    path: Path
    kind: str
    energy: float
    gain: float
    gate_ns: float
    level: str
    pictures: int = 1


@dataclass(frozen=True)
class Series:
    """A folder that passed all checks which need no picture."""

    folder: Path
    setup: Setup
    rows: tuple[Row, ...]
    energy_unit: str
    shape: tuple[int, int]
    notes: tuple[str, ...]

    @property
    def settings(self) -> tuple[float, ...]:
        """The gain settings that frames of light were taken at, rising."""
        return tuple(sorted({row.gain for row in self.rows if row.kind != "dark"}))


def read_folder(folder: str | Path, *, pattern: str | None = None) -> Series:
    """Read and check the table, the setup and every frame's header.

    Parameters
    ----------
    folder : path
        Holds ``camera.toml`` and ``frames.csv`` (columns ``file, kind, energy_J, gain, gate_ns``).
    pattern : str, optional
        For folders without a table: how the files are named, relative to the folder, with the
        columns in braces and ``*`` for anything: ``"{kind}/gain{gain}_E{energy_J}_*.tif"``.

    Raises
    ------
    FolderError
        With every fault found.
    """
    root = Path(folder)
    if not root.is_dir():
        came = "a file" if root.exists() else "no such folder"
        raise FolderError(str(root), [Fault("folder", came, "a folder of calibration frames")])
    setup, faults = read_setup(root / SETUP)
    if pattern is None:
        records, notes, table_faults = _read_table(root / TABLE)
    else:
        records, notes, table_faults = _match_names(root, pattern)
    faults += table_faults
    rows, row_faults = _rows_of(root, records)
    faults += row_faults
    rows, shape, header_faults = _inspect_all(rows, setup)
    faults += header_faults
    if not table_faults:
        faults += _faults_of_whole(rows, setup)
    if faults or setup is None:
        raise FolderError(str(root), faults)
    unit = "J" if any("energy_J" in record for _, record in records) else "relative"
    notes += _unlisted(root, rows) if pattern is None else []
    return Series(root, setup, tuple(rows), unit, shape, tuple(notes))


Record = tuple[str, Mapping[str, str]]


def _read_table(path: Path) -> tuple[list[Record], list[str], list[Fault]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        return (
            [],
            [],
            [
                Fault(
                    path.name,
                    "no such file",
                    f"a table with the columns {', '.join(COLUMNS[:3])}, gain, gate_ns",
                    "Or give a pattern of the file names (--pattern).",
                )
            ],
        )
    except UnicodeDecodeError as error:
        return [], [], [Fault(path.name, f"text that is not UTF-8 ({error})", "a CSV table")]
    lines = list(csv.reader(line for line in text.splitlines()))
    numbered = [
        (number, cells) for number, cells in enumerate(lines, 1) if any(cell.strip() for cell in cells)
    ]
    if not numbered:
        return [], [], [Fault(path.name, "an empty table", "a header line and a row per file")]
    header = [cell.strip() for cell in numbered[0][1]]
    faults, notes = _faults_of_header(path.name, header)
    records: list[Record] = []
    for number, cells in numbered[1:]:
        if len(cells) != len(header):
            faults.append(Fault(f"{path.name} line {number}", f"{len(cells)} cells", f"{len(header)} cells"))
            continue
        record = {name: cell.strip() for name, cell in zip(header, cells, strict=True)}
        records.append((f"{path.name} line {number}", record))
    if not records and not faults:
        faults.append(Fault(path.name, "no rows", "a row per file"))
    return records, notes, faults


def _faults_of_header(table: str, header: list[str]) -> tuple[list[Fault], list[str]]:
    faults, notes = [], []
    for name in ("file", "kind"):
        if name not in header:
            faults.append(Fault(table, f"no column {name!r}", f"the columns {', '.join(COLUMNS[:5])}"))
    for name in sorted({name for name in header if header.count(name) > 1}):
        faults.append(Fault(table, f"the column {name!r} twice", "each column once"))
    for name in header:
        if name in COLUMNS:
            continue
        if get_close_matches(name, COLUMNS, n=1, cutoff=0.75):
            faults.append(Fault(table, f"an unknown column {name!r}", "a known one", nearest(name, COLUMNS)))
        else:
            notes.append(f"{table}: column {name!r} was not used")
    if "energy_J" in header and "energy_rel" in header:
        faults.append(Fault(table, "both energy_J and energy_rel", "one of them"))
    return faults, notes


def _match_names(root: Path, pattern: str) -> tuple[list[Record], list[str], list[Fault]]:
    names = re.findall(r"\{([^{}]*)\}", pattern)
    faults = [
        Fault("pattern", f"{{{name}}}", "a column in braces", nearest(name, COLUMNS[1:]))
        for name in names
        if name not in COLUMNS[1:]
    ]
    if len(set(names)) != len(names):
        faults.append(Fault("pattern", f"{pattern!r} with a column twice", "each column once"))
    if "kind" not in names:
        faults.append(Fault("pattern", f"{pattern!r} without {{kind}}", "{kind} somewhere in the names"))
    if faults:
        return [], [], faults
    finder = re.compile(_expression(pattern))
    records: list[Record] = []
    unmatched = 0
    for path in sorted(root.rglob("*")):
        if path.suffix.lower() not in frames.SUFFIXES:
            continue
        name = path.relative_to(root).as_posix()
        match = finder.fullmatch(name)
        if match is None:
            unmatched += 1
            continue
        records.append(
            (name, {"file": name, **{key: value or "" for key, value in match.groupdict().items()}})
        )
    if not records:
        faults.append(
            Fault(
                "pattern",
                f"{pattern!r}, which fits none of {unmatched} frame files",
                "a pattern that fits, like '{kind}/gain{gain}_E{energy_J}_*.tif'",
            )
        )
    notes = [f"{unmatched} frame files do not fit the pattern and were not used"] if unmatched else []
    return records, notes, faults


def _expression(pattern: str) -> str:
    """Turn the user's pattern into a regular expression; numbers match numbers, ``*`` anything but ``/``."""
    parts = []
    for piece in re.split(r"(\{[^{}]*\}|\*)", pattern):
        name = piece.strip("{}")
        if piece == "*":
            parts.append("[^/]*")
        elif piece.startswith("{") and name == "kind":
            parts.append(rf"(?P<kind>{'|'.join(KINDS)})")
        elif piece.startswith("{") and name == "level":
            parts.append(r"(?P<level>[^/_]+)")
        elif piece.startswith("{"):
            parts.append(rf"(?P<{name}>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)?")
        else:
            parts.append(re.escape(piece))
    return "".join(parts)


def _rows_of(root: Path, records: Iterable[Record]) -> tuple[list[Row], list[Fault]]:
    rows, faults = [], []
    seen: dict[str, str] = {}
    for where, record in records:
        found: list[Fault] = []
        file = record.get("file", "")
        if file in seen:
            found.append(Fault(where, f"{file!r}, already listed in {seen[file]}", "each file once"))
        seen[file] = where
        kind = record.get("kind", "")
        if kind not in KINDS:
            found.append(Fault(where, f"kind {kind!r}", f"one of {', '.join(KINDS)}", nearest(kind, KINDS)))
        numbers = {
            name: _cell(where, name, record.get(name, ""), found)
            for name in ("energy_J", "energy_rel", "gain", "gate_ns")
        }
        energy = numbers["energy_J"] if "energy_J" in record else numbers["energy_rel"]
        _check_energy(where, kind, energy, found)
        gain = numbers["gain"]
        if math.isnan(gain) and kind != "dark":
            gain = 1.0 if not record.get("gain") else math.nan
        if not file or not (root / file).is_file():
            found.append(Fault(where, f"file {file!r}, which is not there", "a frame file in the folder"))
        faults += found
        if not found:
            level = record.get("level", "")
            rows.append(Row(where, root / file, kind, energy, gain, numbers["gate_ns"], level))
    return rows, faults


def _cell(where: str, name: str, text: str, faults: list[Fault]) -> float:
    if not text:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        faults.append(Fault(where, f"{name} {text!r}", "a finite number, or nothing"))
        return math.nan
    return value


def _check_energy(where: str, kind: str, energy: float, faults: list[Fault]) -> None:
    if kind == "dark" and energy > 0.0:
        faults.append(Fault(where, f"energy {energy:g} for dark frames", "no energy for dark frames"))
    elif kind != "dark" and energy <= 0.0:
        faults.append(Fault(where, f"energy {energy:g}", "an energy above 0 (or nothing, when not known)"))


def _inspect_all(rows: list[Row], setup: Setup | None) -> tuple[list[Row], tuple[int, int], list[Fault]]:
    faults: list[Fault] = []
    checked: list[Row] = []
    first: tuple[tuple[int, int], str] | None = None
    for row in rows:
        try:
            info = frames.inspect(row.path)
        except (frames.UnreadableFrameError, OSError) as error:
            faults.append(
                Fault(f"{row.where} ({row.path.name})", str(error), "an 8 to 16 bit grey TIFF or PNG")
            )
            continue
        where = f"{row.where} ({row.path.name})"
        if first is None:
            first = info.shape, row.path.name
        if info.shape != first[0]:
            faults.append(
                Fault(
                    where,
                    f"{info.shape[0]} x {info.shape[1]} pixels",
                    f"{first[0][0]} x {first[0][1]} pixels as in {first[1]}",
                )
            )
        if setup and info.dtype.kind == "u" and info.dtype.itemsize * 8 < setup.bit_depth:
            faults.append(
                Fault(where, f"{info.dtype} pictures", f"pictures that hold {setup.bit_depth} bits")
            )
        checked.append(
            Row(row.where, row.path, row.kind, row.energy, row.gain, row.gate_ns, row.level, info.pictures)
        )
    return checked, first[0] if first else (0, 0), faults


def _faults_of_whole(rows: list[Row], setup: Setup | None) -> list[Fault]:
    """Find what no single row can tell: kinds missing, too few levels."""
    faults = []
    lit = [row for row in rows if row.kind != "dark"]
    if not any(row.kind == "dark" for row in rows):
        faults.append(Fault("frames", "no dark frames", "dark frames, best at every gain setting"))
    if not lit:
        faults.append(Fault("frames", "no frames with light", "response frames at several light levels"))
        return faults
    known = {row.energy for row in lit if not math.isnan(row.energy)}
    if len(known) < 4 and not (setup and len(setup.known_gain) > 1):
        faults.append(
            Fault(
                "frames",
                f"{len(known)} known light levels",
                "at least 4, best 16 or more",
                "Where only ratios are known, give them in the column energy_rel.",
            )
        )
    settings = {row.gain for row in lit}
    if setup and setup.reference_gain is not None and setup.reference_gain not in settings:
        faults.append(
            Fault(
                f"{SETUP}: reference_gain",
                f"{setup.reference_gain:g}",
                f"one of the settings of the frames: {', '.join(f'{gain:g}' for gain in sorted(settings))}",
            )
        )
    return faults


def _unlisted(root: Path, rows: Iterable[Row]) -> list[str]:
    listed = {row.path.resolve() for row in rows}
    extra = [
        path.relative_to(root).as_posix()
        for path in sorted(root.rglob("*"))
        if path.suffix.lower() in frames.SUFFIXES and path.resolve() not in listed
    ]
    if not extra:
        return []
    shown = ", ".join(extra[:5]) + (" ..." if len(extra) > 5 else "")
    return [f"{len(extra)} frame files are not in {TABLE} and were not used: {shown}"]
