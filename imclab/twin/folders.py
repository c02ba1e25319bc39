"""The files of a synthetic experiment, each labelled synthetic."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
import tomli_w
from numpy.typing import NDArray

from imclab.twin.camera import VirtualCamera

METER_ERROR = 0.005  # relative standard error of each noted light level, as camera.toml says
LABEL = "SYNTHETIC: made by `imclab twin`, not measured"


def write_stack(path: Path, stack: NDArray[np.uint16]) -> None:
    """Write frames as one compressed TIFF whose description says that they are synthetic."""
    tifffile.imwrite(
        path, stack, compression="zlib", predictor=True, photometric="minisblack", description=LABEL
    )


def write_calibration(
    folder: Path, camera: VirtualCamera, settings: list[float], *, gate_ns: float, rng: np.random.Generator
) -> None:
    """Write darks, flats, response levels and overlapping gain levels, with their ``frames.csv``."""
    folder.mkdir()
    shape = camera.flat.shape
    rows: list[dict[str, Any]] = []

    def take(kind: str, setting: float, level: float, noted: str, index: int, count: int) -> None:
        file = f"{kind}_{setting:g}_{index:02d}.tif"
        energy = np.full(shape, level)
        write_stack(folder / file, np.stack([camera.frame(energy, setting, rng) for _ in range(count)]))
        rows.append({"file": file, "kind": kind, "energy_J": noted, "gain": setting, "gate_ns": gate_ns})

    def noted(level: float) -> str:
        """What the light meter reads, which is not quite the truth."""
        return f"{level * (1.0 + METER_ERROR * rng.standard_normal()):.6e}"

    for setting in settings:
        take("dark", setting, 0.0, "", 0, 8)
        even = camera.levels(setting, [0.45])[0]
        take("flat", setting, even, noted(even), 0, 6)
    for index, level in enumerate(camera.levels(settings[0], np.geomspace(0.01, 1.6, 16))):
        take("response", settings[0], level, noted(level), index, 2)
    top = camera.gain_ratio(settings[-1]) / camera.gain_ratio(settings[0])
    for index, level in enumerate(camera.levels(settings[0], np.geomspace(0.05 / top, 0.7, 8))):
        read = noted(level)  # one light level for all settings
        for setting in settings:
            take("gain", setting, level, read, index, 2)
    with (folder / "frames.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ["file", "kind", "energy_J", "gain", "gate_ns"])
        writer.writeheader()
        writer.writerows(rows)
    text = tomli_w.dumps(
        {
            "name": "virtual ICMOS (synthetic)",
            "bit_depth": camera.chain.bit_depth,
            "wavelength": f"{camera.chain.wavelength * 1e9:g} nm",
            "gain_unit": "V",
            "energy_stderr": METER_ERROR,
        }
    )
    (folder / "camera.toml").write_text(f"# {LABEL}\n{text}", encoding="utf-8")


def write_experiment(
    folder: Path, title: str, changes: Mapping[str, dict[str, Any]], settings: Mapping[str, float]
) -> None:
    """Write ``experiment.toml``: one condition for each name in ``changes``."""
    firsts: dict[str, str] = {}
    conditions = []
    for name, change in changes.items():
        reference = firsts.setdefault(name.rsplit("-", 1)[0], name)
        conditions.append(
            {
                "name": name,
                "frames": [f"frames/{name}.tif"],
                "gain": settings[name],
                "reference": reference,
                "scene": change,
            }
        )
    document = {
        "schema": 1,
        "title": title or "Synthetic experiment",
        "synthetic": True,
        "scene": "scene.toml",
        "calibration": "calibration",
        "reference": conditions[0]["name"],
        "condition": conditions,
    }
    text = f"# {LABEL}\n{tomli_w.dumps(document)}"
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
