"""The virtual rig: its geometry, its labels, and that its folder is complete."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import tifffile

import imclab
import imclab.twin
from imclab.errors import InputError
from imclab.experiment import load_experiment
from imclab.twin import TwinPlan, depths_from_text, make_twin
from imclab.twin.geometry import project
from tests.pictures import picture_of

DATA = Path(__file__).parents[2] / "data"


def test_projection_keeps_the_energy_and_puts_a_spot_where_the_matrix_says() -> None:
    y, x = np.mgrid[:60, :80]
    spot = np.exp(-((x - 50.0) ** 2 + (y - 20.0) ** 2) / (2 * 3.0**2))
    angle, scale = 0.1, 0.8
    matrix = np.array(
        [
            [scale * np.cos(angle), -scale * np.sin(angle), 7.0],
            [scale * np.sin(angle), scale * np.cos(angle), 3.5],
            [0, 0, 1],
        ]
    )
    seen = project(spot, matrix, (64, 64))
    assert seen.sum() == pytest.approx(spot.sum(), rel=1e-3)
    rows, columns = np.mgrid[:64, :64]
    centre = np.array([(seen * columns).sum(), (seen * rows).sum()]) / seen.sum()
    assert centre == pytest.approx((matrix @ [50.0, 20.0, 1.0])[:2], abs=5e-3)
    assert np.abs(centre - (matrix @ [50.3, 20.0, 1.0])[:2]).max() > 0.1  # a third of a pixel would show


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("twin") / "tank"
    plan = TwinPlan(
        optical_depths=(0.42, 1.42), masks=(DATA / "targets/double_slit.png",), frames=3, frame_shape=(64, 72)
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(imclab.twin, "simulate", picture_of)
        make_twin(imclab.load_scene(DATA / "scenes/tank.toml"), place, plan)
    return place


def test_the_folder_is_an_experiment_with_its_truth(folder: Path) -> None:
    experiment = load_experiment(folder / "experiment.toml")
    truth = json.loads((folder / "truth.json").read_text())
    assert experiment.synthetic
    assert [condition.name for condition in experiment.condition] == list(truth["conditions"])
    for condition in experiment.condition:
        frames = tifffile.imread(experiment.files_of(condition)[0])
        assert frames.shape == (3, 64, 72)
        assert experiment.scene_of(condition).figure_mask.shape == (1000, 1000)
    ratio = [truth["conditions"][c.name]["energy_J"] for c in experiment.condition]
    assert ratio[1] / ratio[0] == pytest.approx(np.exp(-2.0), rel=0.01)


def test_every_file_says_that_it_is_synthetic(folder: Path) -> None:
    for path in folder.rglob("*"):
        if path.suffix in (".toml", ".json"):
            assert "SYNTHETIC" in path.read_text(), path
        if path.suffix == ".tif":
            with tifffile.TiffFile(path) as tiff:
                assert "SYNTHETIC" in tiff.pages[0].tags["ImageDescription"].value, path


def test_a_folder_with_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    with pytest.raises(InputError, match="empty"):
        make_twin(imclab.load_scene(DATA / "scenes/tank.toml"), tmp_path, TwinPlan())
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_a_missing_target_leaves_nothing_behind(tmp_path: Path) -> None:
    plan = TwinPlan(masks=(tmp_path / "none.png",))
    with pytest.raises(InputError, match=r"none\.png"):
        make_twin(imclab.load_scene(DATA / "scenes/tank.toml"), tmp_path / "tank", plan)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", ["", "0.42,x", "-1", "0"])
def test_refuses_what_are_no_optical_depths(text: str) -> None:
    with pytest.raises(InputError, match="optical-depths"):
        depths_from_text(text)
