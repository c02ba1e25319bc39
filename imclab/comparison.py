"""Measured against simulated, condition by condition, in joules first and in counts second.

The simulation is warped onto the measured frame; the measurement is never resampled, which would
smooth its noise and flatter every metric. Bad and saturated pixels are left out of both sides.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from imclab.registration import Registration
from imclab.result import Result
from imclab.uncertainty import ComparisonError, Estimate

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Pair:
    """One condition, measured and simulated on the same camera pixels.

    Pictures are rounded: energies and counts to 24 bits (6e-8 of themselves), standard uncertainties
    to 12 bits (2e-4). That is far below what either is known to, and makes a file of them small.

    Attributes
    ----------
    name, gain, optical_depth
        The condition.
    result : Result
        The run's numbers; its pictures, on their own pixels, are in the result's file.
    frames : int
        How many frames the measurement is the mean of.
    measured, measured_stderr : array (rows, columns)
        Energy per camera pixel, J; NaN where a pixel is bad or saturated.
    simulated, simulated_stderr : array (rows, columns)
        Simulated energy per camera pixel, J, times ``throughput``.
    measured_counts, simulated_counts : array (rows, columns)
        The same two pictures in counts above dark at this gain.
    region : bool array (rows, columns)
        Camera pixels that see the target and are good: all sums and metrics are taken over these.
    throughput : float
        Measured over simulated energy at the reference condition: transmission of the optics that
        the scene does not model. One number for all conditions with the same reference.
    """

    name: str
    gain: float
    optical_depth: float
    frames: int
    result: Result
    registration: Registration
    measured: FloatArray
    measured_stderr: FloatArray
    simulated: FloatArray
    simulated_stderr: FloatArray
    measured_counts: FloatArray
    simulated_counts: FloatArray
    region: NDArray[np.bool_]
    throughput: Estimate

    @property
    def z_map(self) -> FloatArray:
        """Difference simulated - measured over its standard uncertainty, pixel by pixel."""
        spread = np.hypot(self.measured_stderr, self.simulated_stderr)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.where(self.region, (self.simulated - self.measured) / spread, np.nan))


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What the comparison says of one condition.

    Attributes
    ----------
    measured_ratio, simulated_ratio : Estimate
        Energy of the target over that of the reference condition.
    error : ComparisonError
        Of the two ratios, with its budget.
    metrics : mapping of Estimate
        ssim, mssim, psnr (dB), luminance_mssim of simulated against measured counts.
    degradation : mapping of (simulated Estimate, measured Estimate)
        The same metrics of this condition against its reference condition, within the simulation
        and within the measurement: the paper's table 1.
    noisy_degradation : mapping of Estimate
        The same within the simulation after the camera's noise of one frame is put on both pictures:
        what the measured metrics should be.
    input_steps : mapping of float
        Relative standard uncertainty from each uncertain input of the scene by itself, from one step
        of it. These are in the budget of ``error``, unless scenes were drawn.
    input_draws : int
        How many scenes were drawn within those uncertainties; their spread is then in the budget.
    """

    pair: Pair
    reference: str
    measured_ratio: Estimate
    simulated_ratio: Estimate
    error: ComparisonError
    metrics: Mapping[str, Estimate]
    degradation: Mapping[str, tuple[Estimate, Estimate]]
    noisy_degradation: Mapping[str, Estimate] = field(default_factory=dict)
    input_steps: Mapping[str, float] = field(default_factory=dict)
    input_draws: int = 0


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """The whole experiment compared.

    Attributes
    ----------
    outcomes : tuple of Outcome
        In the order of the experiment file.
    covariance : array (conditions, conditions)
        Of the relative errors E, all sources together; rows and columns of reference conditions
        are zero.
    data_range : float
        L of every metric: full scale of the camera in counts.
    """

    title: str
    synthetic: bool
    outcomes: tuple[Outcome, ...]
    covariance: FloatArray
    data_range: float
