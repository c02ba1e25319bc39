"""One file, whole or not at all, that says when it was tampered with."""

from pathlib import Path

import h5py
import numpy as np
import pytest

import calibration
from tests.unit.calibration.conftest import Calibrated


def test_what_is_saved_comes_back(calibrated: Calibrated, tmp_path: Path) -> None:
    camera = calibrated.camera
    camera.save(tmp_path / "camera.h5")
    again = calibration.load(tmp_path / "camera.h5")
    frame = calibrated.truth.frame(4e-17, 760.0, np.random.default_rng(1))
    for one, other in zip(camera.energy(frame, gain=760), again.energy(frame, gain=760), strict=True):
        assert np.array_equal(one, other, equal_nan=True)
    assert again.gains == camera.gains and again.setup == camera.setup and again.notes == camera.notes
    assert repr(again.figures) == repr(camera.figures)
    assert np.array_equal(again.covariance, camera.covariance)
    assert len(again.provenance["frames"]) > 50 and len(again.provenance["digest"]) == 64
    assert [path.name for path in tmp_path.iterdir()] == ["camera.h5"]
    assert not again.defects.flags.writeable


def test_a_damaged_file_is_refused(calibrated: Calibrated, tmp_path: Path) -> None:
    path = tmp_path / "camera.h5"
    calibrated.camera.save(path)
    with h5py.File(path, "r+") as file:
        file["gain/log_gain"][1] += 0.1
    with pytest.raises(calibration.StoredFileError, match="digest"):
        calibration.load(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(calibration.StoredFileError, match="not a whole calibration"):
        calibration.load(path)


def test_other_files_are_named(tmp_path: Path, calibrated: Calibrated) -> None:
    with pytest.raises(calibration.StoredFileError, match="no such file"):
        calibration.load(tmp_path / "none.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    with pytest.raises(calibration.StoredFileError, match="not a calibration"):
        calibration.load(tmp_path / "other.h5")
    with pytest.raises(calibration.StoredFileError, match="does not exist"):
        calibrated.camera.save(tmp_path / "no folder" / "camera.h5")
