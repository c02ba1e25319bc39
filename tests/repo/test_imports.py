"""The house: which package may know which, and what stays light."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

# Lower never imports higher. A module's floor is that of the longest name that it starts with.
FLOORS = {
    "imclab.errors": 0,
    "imclab.units": 0,
    "imclab.files": 1,
    "imclab.provenance": 1,
    "imclab.schema": 1,
    "imclab.optics": 1,
    "imclab.materials": 2,
    "imclab.media": 2,
    "imclab.scene": 3,
    "imclab.scene_reference": 4,
    "imclab.result": 4,
    "imclab.transport": 5,
    "imclab.detector": 5,
    "imclab.metrics": 5,
    "imclab.registration": 5,
    "imclab.uncertainty": 5,
    "imclab.inputs": 5,
    "imclab.similarity": 6,
    "imclab.experiment": 6,
    "imclab.comparison": 6,
    "imclab.agreement": 7,
    "imclab.sharpness": 7,
    "imclab.sighting": 7,
    "imclab.budget": 7,
    "imclab.assessment": 7,
    "imclab.twin": 7,
    "imclab.bench": 7,
    "imclab.sweep": 7,
    "imclab.study": 8,
    "imclab.report": 8,
    "imclab.commands": 9,
    "imclab.cli": 10,
    "imclab.__main__": 11,
}


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(path: Path) -> set[str]:
    """Every module that the file names in an import, wherever the import stands."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def floor(name: str) -> int | None:
    parts = name.split(".")
    for length in range(len(parts), 1, -1):
        found = FLOORS.get(".".join(parts[:length]))
        if found is not None:
            return found
    return None


@pytest.mark.parametrize(("leaf", "others"), [("rig", "calibration"), ("calibration", "rig")])
def test_leaves_know_neither_each_other_nor_the_trunk(leaf: str, others: str) -> None:
    for path in modules(leaf):
        tops = {name.split(".")[0] for name in imported(path)}
        assert not tops & {others, "imclab", "numba", "cv2"}, path


def test_data_flows_one_way_through_the_trunk() -> None:
    for path in modules("imclab"):
        own = floor(module_name(path))
        if module_name(path) == "imclab":
            continue
        assert own is not None, f"{path} has no floor: add its package to FLOORS"
        for name in imported(path):
            other = floor(name)
            if other is not None:
                assert other <= own, f"{module_name(path)} imports {name}, which stands above it"


def test_numba_and_serial_have_one_home_each() -> None:
    allowed = {
        "numba": ("imclab/transport/", "imclab/optics/mie", "imclab/metrics", "imclab/registration"),
        "serial": ("rig/link.py",),
    }
    for package in ("imclab", "rig", "calibration"):
        for path in modules(package):
            place = path.relative_to(ROOT).as_posix()
            tops = {name.split(".")[0] for name in imported(path)}
            for library, homes in allowed.items():
                assert library not in tops or place.startswith(homes), f"{place} imports {library}"


@pytest.mark.parametrize("statement", ["import imclab", "from imclab.cli import run; run(['--help'])"])
def test_stays_light(statement: str) -> None:
    heavy = "numba cv2 matplotlib scipy skimage pydantic h5py pint"
    code = f"import sys; {statement}; print(*(set(sys.modules) & set('{heavy}'.split())), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stderr.split() == []
