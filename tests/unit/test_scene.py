"""Scenes: what a file may say, and every fault of it in one message."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from skimage.io import imsave

import imclab
from imclab.errors import InputError
from imclab.scene import Scene

DOCUMENT: dict[str, Any] = {
    "schema": 1,
    "title": "one",
    "medium": {
        "attenuation": "0.42 1/m",
        "albedo": 0.89,
        "refractive_index": 1.34,
        "group_index": 1.364,
        "phase_function": {"kind": "henyey-greenstein", "g": 0.924},
    },
    "laser": {
        "wavelength": "532 nm",
        "pulse_energy": "20 uJ",
        "pulse_fwhm": "4.5 ns",
        "divergence_fwhm": "200 mrad",
        "spot_fwhm": "1 mm",
    },
    "target": {
        "distance": "1 m",
        "width": "5 cm",
        "height": "5 cm",
        "figure": {"kind": "lambertian", "reflectance": 0.5},
    },
    "receiver": {"aperture_radius": "12.5 mm", "pixels": [20, 10]},
    "gate": {"delay": "7.44 ns", "width": "3 ns"},
}


def changed(path: str, value: Any) -> dict[str, Any]:
    document = copy.deepcopy(DOCUMENT)
    *tables, key = path.split(".")
    place = document
    for table in tables:
        place = place.setdefault(table, {})
    place[key] = value
    return document


def faults_of(document: dict[str, Any], folder: Path = Path()) -> dict[str, str]:
    with pytest.raises(InputError) as caught:
        Scene.from_document(document, folder=folder)
    return {fault.where: str(fault) for fault in caught.value.faults}


def test_reads_quantities_into_si() -> None:
    scene = Scene.from_document(DOCUMENT)
    assert scene.medium.attenuation == 0.42
    assert scene.laser.pulse_fwhm == 4.5e-9
    assert scene.receiver.position == (0.0, 0.0, 0.0)
    assert scene.receiver.field_of_view == pytest.approx(np.pi)
    assert scene.figure_mask.tolist() == [[True]]


def test_all_faults_come_together_with_their_paths_and_the_nearest_key() -> None:
    document = changed("medium.attenuaton", "1 1/m")
    document["medium"]["albedo"] = 1.89
    document["laser"]["wavelength"] = "532 kg"
    document["target"]["distance"] = "-1 m"
    document["target"]["figure"] = {"kind": "lambertan", "reflectance": 0.5}
    document["receiver"]["pixels"] = [20]
    faults = faults_of(document)
    assert set(faults) == {
        "medium.attenuaton",
        "medium.albedo",
        "laser.wavelength",
        "target.distance",
        "target.figure.kind",
        "receiver.pixels[1]",
    }
    assert 'Did you mean "attenuation"' in faults["medium.attenuaton"]
    assert 'Did you mean "lambertian"' in faults["target.figure.kind"]
    assert "532 kg" in faults["laser.wavelength"]


@pytest.mark.parametrize(
    ("path", "value", "where"),
    [
        ("gate.center", "target", "gate"),
        ("medium.type", "jerlov-II", "medium"),
        ("medium.phase_function.g", 1.5, "medium.phase_function.g"),
        ("medium.phase_function.kind", "hg", "medium.phase_function.kind"),
        ("receiver.field_of_view", "400 deg", "receiver.field_of_view"),
        ("receiver.pixels", [0, 10], "receiver.pixels[0]"),
        ("run.rel_error", -1, "run.rel_error"),
        ("run", {"seconds": 1, "packets": 10}, "run"),
        ("target.figure.reflectance", 1.2, "target.figure.reflectance"),
        ("target.mask", "none.png", "target"),
        ("laser.pulse_energy", float("nan"), "laser.pulse_energy"),
        ("schema", 2, "schema"),
        ("lasers", {}, "lasers"),
    ],
)
def test_each_single_fault_has_its_path(path: str, value: Any, where: str) -> None:
    assert list(faults_of(changed(path, value))) == [where]


def test_clear_water_needs_no_phase_function() -> None:
    document = changed("medium", {"attenuation": "0 1/m", "albedo": 0.0})
    assert Scene.from_document(document).medium.phase_function is None
    assert list(faults_of(changed("medium", {"attenuation": "1 1/m", "albedo": 0.5}))) == ["medium"]


def test_with_changes_a_copy() -> None:
    scene = Scene.from_document(DOCUMENT)
    other = scene.with_(**{"medium.attenuation": "1.42 1/m", "gate": None})
    assert (scene.medium.attenuation, other.medium.attenuation) == (0.42, 1.42)
    assert other.gate is None
    with pytest.raises(InputError, match="attenuation"):
        scene.with_(**{"medium.attenuaton": "1 1/m"})
    with pytest.raises(InputError, match="through tables"):
        scene.with_(**{"title.x": 1})


def test_toml_gives_the_scene_back() -> None:
    scene = Scene.from_document(DOCUMENT)
    import tomllib

    assert Scene.from_document(tomllib.loads(scene.toml)) == scene


def ground(mask: str) -> dict[str, Any]:
    document = changed("target.mask", mask)
    document["target"]["ground"] = {"kind": "lambertian", "reflectance": 0.1}
    return document


@pytest.mark.parametrize("kind", ["grey", "rgb", "bool"])
def test_reads_masks(tmp_path: Path, kind: str) -> None:
    wanted = np.array([[True, False, False], [True, True, False]])
    picture = {
        "grey": wanted * np.uint8(255),
        "rgb": np.repeat((wanted * np.uint8(255))[..., None], 3, axis=2),
        "bool": wanted * np.uint8(1),
    }[kind]
    imsave(tmp_path / "mask.png", picture, check_contrast=False)
    scene = Scene.from_document(ground("mask.png"), folder=tmp_path)
    assert np.array_equal(scene.figure_mask, wanted)


@pytest.mark.parametrize("kind", ["missing", "text", "grey levels", "coloured"])
def test_refuses_masks_of_the_wrong_kind(tmp_path: Path, kind: str) -> None:
    if kind == "text":
        (tmp_path / "mask.png").write_text("no picture")
    if kind == "grey levels":
        imsave(tmp_path / "mask.png", np.arange(64, dtype=np.uint8).reshape(8, 8), check_contrast=False)
    if kind == "coloured":
        imsave(tmp_path / "mask.png", np.full((4, 4, 3), (255, 0, 0), np.uint8), check_contrast=False)
    assert list(faults_of(ground("mask.png"), tmp_path)) == ["target.mask"]


def test_missing_and_broken_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        imclab.load_scene(tmp_path / "none.toml")
    (tmp_path / "broken.toml").write_text("schema = ")
    with pytest.raises(InputError, match="TOML"):
        imclab.load_scene(tmp_path / "broken.toml")
