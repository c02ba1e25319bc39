"""Calibrate an intensified camera: response, gain, noise, each with its uncertainty.

>>> camera = calibration.calibrate("folder")            # doctest: +SKIP
>>> energy, stderr = camera.energy(counts, gain=750)    # doctest: +SKIP
"""

from calibration.correct import Defect
from calibration.errors import (
    CalibrationError,
    Fault,
    FolderError,
    SettingError,
    ShapeError,
    StoredFileError,
)
from calibration.model import Calibration
from calibration.procedure import calibrate
from calibration.setting import Figure, Flag
from calibration.storage import load

__all__ = [
    "Calibration",
    "CalibrationError",
    "Defect",
    "Fault",
    "Figure",
    "Flag",
    "FolderError",
    "SettingError",
    "ShapeError",
    "StoredFileError",
    "calibrate",
    "load",
]
