"""How alike two pictures are: MSE, PSNR, SSIM, MSSIM, each by one stated definition.

The data range is always given. With ``mssim`` beside ``luminance_mssim`` a published figure can be
recognised for what it is. Intervals come from repeated frames or from a noise model.
"""

from __future__ import annotations

from imclab.metrics.confidence import Interval, confidence_from_frames, confidence_from_noise
from imclab.metrics.pictures import DataRangeWarning, range_advice
from imclab.metrics.scores import luminance_mssim, mse, mssim, mssim_map, psnr, ssim

__all__ = [
    "DataRangeWarning",
    "Interval",
    "confidence_from_frames",
    "confidence_from_noise",
    "luminance_mssim",
    "mse",
    "mssim",
    "mssim_map",
    "psnr",
    "range_advice",
    "ssim",
]
