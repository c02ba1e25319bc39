"""One condition seen by both sides: measured energy and the simulated picture on the camera's pixels.

The simulation is warped onto the measured frame and spread as the camera's own noise shows that it
spreads light; the measurement is never resampled. Bad and saturated pixels are left out of both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve

from calibration import Calibration
from calibration.noise import spreading_kernel
from imclab.errors import Fault
from imclab.registration import Registration, register
from imclab.result import Result

FloatArray = NDArray[np.float64]
WANTED = "the target of its scene, visible above the noise and inside the frame"


@dataclass(frozen=True, kw_only=True)
class Sighting:
    """What one condition brings to the comparison, before anything is relative.

    Attributes
    ----------
    counts : array (frames, rows, columns)
        As the camera gave them.
    input_effects : mapping of (float, bool)
        For each uncertain input: the relative change of the simulated energy when it moves by its
        standard uncertainty, and whether that error is common to all conditions.
    drawn_totals : tuple of float
        Simulated energy over that of ``result`` for each scene drawn within the inputs'
        uncertainties; draw by draw the same errors in every condition. Empty without draws.
    """

    name: str
    reference: str
    gain: float
    optical_depth: float
    counts: NDArray[np.uint16]
    result: Result
    input_effects: Mapping[str, tuple[float, bool]]
    drawn_totals: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Seen:
    """A sighting turned into energy on the camera's pixels."""

    sighting: Sighting
    registration: Registration
    energy: FloatArray  # (frames, rows, columns), NaN where bad or saturated
    stderr: FloatArray  # (rows, columns) of the mean
    simulated: FloatArray
    simulated_stderr: FloatArray
    region: NDArray[np.bool_]

    @property
    def frame_sums(self) -> FloatArray:
        """Energy of the region in each frame, J."""
        return np.asarray(self.energy[:, self.region].sum(axis=1))

    @property
    def measured_sum(self) -> float:
        """Mean of the frames' sums, J."""
        return float(self.frame_sums.mean())

    @property
    def simulated_sum(self) -> float:
        """Simulated energy of the region, J."""
        return float(self.simulated[self.region].sum())

    @property
    def scale(self) -> float:
        """Measured over simulated energy."""
        return self.measured_sum / self.simulated_sum

    @property
    def frame_dof(self) -> float:
        """Degrees of freedom of `frame_error`: one less than frames, endless when noise is calibrated."""
        return len(self.energy) - 1 if len(self.energy) > 1 else math.inf

    @property
    def frame_error(self) -> float:
        """Relative standard error of the measured sum."""
        sums = self.frame_sums
        if len(sums) > 1:
            return float(sums.std(ddof=1) / np.sqrt(len(sums)) / sums.mean())
        return float(np.sqrt((self.stderr[self.region] ** 2).sum()) / sums.mean())


def see(sighting: Sighting, camera: Calibration, model: str) -> Seen | Fault:
    """Bring both sides of a condition together; a `Fault` when the frames do not show the target."""
    energy, single = camera.energy(sighting.counts, gain=sighting.gain)
    frames = len(energy)
    stderr = energy.std(axis=0, ddof=1) / np.sqrt(frames) if frames > 1 else single[0]
    registration = register(sighting.result.energy, sighting.counts.mean(axis=0), model=model)
    if not registration.ok:
        return Fault(
            f"condition {sighting.name}", f"frames without the target ({registration.reason})", WANTED
        )
    area = area_per_pixel(registration.matrix, sighting.counts.shape[1:])
    seen = registration.warp_fixed(sighting.result.energy)
    inside = np.isfinite(seen)
    spread = spreading_kernel(camera.noise_correlation(sighting.gain))
    return Seen(
        sighting=sighting,
        registration=registration,
        energy=energy,
        stderr=stderr,
        simulated=convolve(np.nan_to_num(seen) * area, spread),
        simulated_stderr=registration.warp_fixed(sighting.result.energy_stderr, fill=0.0) * area,
        region=inside & np.isfinite(energy).all(axis=0),
    )


def area_per_pixel(matrix: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Area of the simulated picture, in its pixels, that one camera pixel sees; shape (rows, columns).

    The determinant of the inverse map's Jacobian: constant unless ``matrix`` has perspective.
    """
    inverse = np.linalg.inv(matrix)
    y, x = np.mgrid[: shape[0], : shape[1]]
    depth = inverse[2, 0] * x + inverse[2, 1] * y + inverse[2, 2]
    return np.asarray(abs(np.linalg.det(inverse)) / np.abs(depth) ** 3)


def dark_of(camera: Calibration, gain: float) -> FloatArray:
    """Dark level of each pixel at a gain setting, counts."""
    return np.asarray(camera.setting(gain).dark, dtype=np.float64)
