"""Experiment files and frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
import tomli_w
from skimage.io import imsave

from imclab.errors import InputError
from imclab.experiment import load_experiment, read_frames
from imclab.inputs import moved_by_its_uncertainty
from imclab.scene import Scene
from tests.unit.test_scene import DOCUMENT

GROUND = {"kind": "lambertian", "reflectance": 0.1}


def write(folder: Path, **changes: Any) -> Path:
    """Write a small experiment and return its file."""
    (folder / "scene.toml").write_text(tomli_w.dumps(DOCUMENT))
    (folder / "calibration").mkdir(exist_ok=True)
    (folder / "targets").mkdir(exist_ok=True)
    bars = np.zeros((4, 4), np.uint8)
    bars[:, 2:] = 255
    imsave(folder / "targets" / "bars.png", bars, check_contrast=False)
    frame = np.random.default_rng(1).integers(90, 400, (3, 8, 8)).astype(np.uint16)
    tifffile.imwrite(folder / "a.tif", frame, photometric="minisblack")
    document: dict[str, Any] = {
        "schema": 1,
        "scene": "scene.toml",
        "calibration": "calibration",
        "reference": "near",
        "condition": [
            {"name": "near", "frames": ["a.tif"], "gain": 700},
            {
                "name": "far",
                "frames": ["*.tif"],
                "gain": 750,
                "scene": {
                    "medium.attenuation": "1.42 1/m",
                    "target": {
                        "mask": "targets/bars.png",
                        "ground": {"kind": "lambertian", "reflectance": 0.1},
                    },
                },
            },
        ],
    }
    document |= changes
    (folder / "experiment.toml").write_text(tomli_w.dumps(document))
    return folder / "experiment.toml"


def test_conditions_change_the_base_scene(tmp_path: Path) -> None:
    experiment = load_experiment(write(tmp_path))
    near, far = experiment.condition
    assert experiment.scene_of(near).medium.attenuation == 0.42
    scene = experiment.scene_of(far)
    assert scene.medium.attenuation == 1.42
    assert scene.figure_mask.shape == (4, 4)
    assert experiment.reference_of(far) is near
    assert experiment.files_of(far) == (tmp_path / "a.tif",)


def test_faults_of_all_conditions_come_together(tmp_path: Path) -> None:
    conditions = [
        {"name": "near", "frames": ["none_*.tif"], "gain": 700},
        {"name": "far", "frames": ["a.tif"], "gain": 700, "scene": {"medium.attenuaton": "1 1/m"}},
    ]
    with pytest.raises(InputError) as caught:
        load_experiment(write(tmp_path, condition=conditions, calibration="none"))
    text = str(caught.value)
    assert "3 faults" in text
    assert "none_*.tif" in text
    assert 'Did you mean "attenuation"' in text
    assert "calibration" in text


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"reference": "other"}, "other"),
        ({"condition": []}, "condition"),
        ({"conditions": []}, 'Did you mean "condition"'),
        ({"schema": 3}, "schema"),
    ],
)
def test_each_fault_is_named(tmp_path: Path, changes: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        load_experiment(write(tmp_path, **changes))


def frames_of(folder: Path, *pictures: np.ndarray) -> tuple[Path, ...]:
    files = []
    for index, picture in enumerate(pictures):
        files.append(folder / f"{index}.tif")
        tifffile.imwrite(files[-1], picture, photometric="minisblack")
    return tuple(files)


def test_reads_stacks_and_single_frames_together(tmp_path: Path) -> None:
    frames = np.arange(2 * 5 * 6, dtype=np.uint16).reshape(2, 5, 6)
    assert np.array_equal(
        read_frames(frames_of(tmp_path, frames, frames[0]), bit_depth=12), frames[[0, 1, 0]]
    )


def ramp(rows: int, columns: int) -> np.ndarray:
    return np.arange(rows * columns, dtype=np.uint16).reshape(rows, columns)


@pytest.mark.parametrize(
    ("pictures", "says"),
    [
        ([np.full((4, 4), 4095, np.uint16)], "saturated"),
        ([np.full((4, 4), 96, np.uint16)], "all pixels 96"),
        (
            [np.arange(16, dtype=np.uint16).reshape(4, 4), np.arange(20, dtype=np.uint16).reshape(4, 5)],
            "one size",
        ),
        ([np.arange(16, dtype=np.uint16).reshape(4, 4) * 4000], "at most 4095"),
        ([np.arange(16, dtype=np.float32).reshape(4, 4)], "TIFF or PNG"),
    ],
)
def test_refuses_frames_that_are_no_pictures(tmp_path: Path, pictures: list[np.ndarray], says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_frames(frames_of(tmp_path, *pictures), bit_depth=12)


def test_inputs_move_by_their_uncertainty() -> None:
    scene = Scene.from_document(DOCUMENT)
    assert moved_by_its_uncertainty(scene, "medium.attenuation", "0.01 1/m").medium.attenuation == 0.43
    assert moved_by_its_uncertainty(scene, "medium.albedo", 0.01).medium.albedo == pytest.approx(0.90)
    assert moved_by_its_uncertainty(scene, "target.distance", "2 mm").target.distance == 1.002


@pytest.mark.parametrize(
    ("dotted", "spread"),
    [("medium.attenuation", 0.01), ("medium.attenuation", "1 kg"), ("medium.none", 1.0), ("title", "1 m")],
)
def test_an_uncertainty_of_another_kind_is_refused(dotted: str, spread: str | float) -> None:
    with pytest.raises(InputError, match=f"uncertainty.{dotted}"):
        moved_by_its_uncertainty(Scene.from_document(DOCUMENT), dotted, spread)
