"""One synthetic camera, calibrated once for all tests that only look at it."""

from pathlib import Path
from typing import NamedTuple

import pytest

import calibration
from tests.camera_truth import Plan, TrueCamera, write_folder


class Calibrated(NamedTuple):
    truth: TrueCamera
    folder: Path
    camera: calibration.Calibration


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Calibrated:
    """Synthetic S-shaped 12 bit camera with four settings, events spread over 0.6 px."""
    truth = TrueCamera(family="S", spread=0.6, gains={700.0: 1.0, 730.0: 2.0, 760.0: 4.0, 790.0: 8.0})
    folder = write_folder(truth, tmp_path_factory.mktemp("calibration") / "frames", Plan(frames=4), seed=11)
    return Calibrated(truth, folder, calibration.calibrate(folder))
