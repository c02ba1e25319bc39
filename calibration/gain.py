"""The intensifier's gain against its setting: the measured points, and laws to check them against.

The points of the joint fit are the truth. An exponential and a power of the setting (the
micro-channel plate's usual laws: Wiza 1979, Nucl. Instrum. Methods 162, 587) are only descriptions:
interpolation between settings is allowed where one of them holds the points, and carries what they
miss as an additional error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from calibration.errors import SettingError

Floats = NDArray[np.float64]

LARGEST_WIGGLE = 0.05  # of the gain: a law that misses the points by more does not describe them
FEWEST_SETTINGS = 4


@dataclass(frozen=True)
class GainLaw:
    """A law fitted to the measured gains.

    Attributes
    ----------
    name : str
        "exponential" (log G straight in the setting) or "power" (straight in its logarithm).
    slope, slope_stderr : float
        Per unit of the setting, or the power k of G ~ V^k.
    intercept : float
        log G where the coordinate is 0.
    wiggle : float
        Standard deviation of the points about the law beyond their own errors (relative gain).
    probability : float
        Chance of a misfit this large if the law were exact (chi-square); small means not exact.
    supported : bool
        Whether the law may be used to interpolate.
    """

    name: str
    slope: float
    slope_stderr: float
    intercept: float
    wiggle: float
    probability: float
    supported: bool

    def log_gain(self, setting: Floats | float) -> Floats:
        """Logarithm of the gain that the law gives."""
        at = np.asarray(setting, dtype=np.float64)
        return np.asarray(self.intercept + self.slope * (np.log(at) if self.name == "power" else at))


def fit_law(settings: Floats, log_gain: Floats, covariance: Floats) -> GainLaw | None:
    """Fit both laws to the measured gains and give the better one; None with fewer than 3 settings.

    Parameters
    ----------
    settings, log_gain : Floats
        The points.
    covariance : Floats
        Of ``log_gain``; the reference's row may be zero.
    """
    if settings.size < 3:
        return None
    laws = [_fit(settings, "exponential", log_gain, covariance)]
    if settings.min() > 0.0:
        laws.append(_fit(settings, "power", log_gain, covariance))
    return min(laws, key=lambda law: law.wiggle)


def _fit(settings: Floats, name: str, log_gain: Floats, covariance: Floats) -> GainLaw:
    at = np.log(settings) if name == "power" else settings
    design = np.stack([np.ones(at.size), at - at.mean()], axis=1)
    # An exactly known reference would pin the line to itself: every point gets a least error.
    floor = 1e-8 * np.eye(at.size)
    freedom = at.size - 2
    wiggle = 0.0
    for _ in range(30):
        total = covariance + floor + wiggle**2 * np.eye(at.size)
        inverse = np.linalg.inv(total)
        spread = np.linalg.inv(design.T @ inverse @ design)
        line = spread @ design.T @ inverse @ log_gain
        rest = log_gain - design @ line
        misfit = float(rest @ inverse @ rest)
        if wiggle == 0.0:
            probability = float(stats.chi2.sf(misfit, freedom))
        if misfit <= freedom:
            break
        wiggle = max(wiggle, 1e-4) * min(3.0, np.sqrt(misfit / freedom)) * 1.0001
    return GainLaw(
        name=name,
        slope=float(line[1]),
        slope_stderr=float(np.sqrt(spread[1, 1])),
        intercept=float(line[0] - line[1] * at.mean()),
        wiggle=float(wiggle),
        probability=probability,
        supported=bool(at.size >= FEWEST_SETTINGS and wiggle < LARGEST_WIGGLE),
    )


class GainAt(NamedTuple):
    """The gain at one setting.

    ``weights`` say how much each calibrated setting's error goes into it, ``law_variance`` what the
    law adds between two of them; ``neighbours`` are the settings on both sides (the same one twice
    at a calibrated setting) and ``share`` the way from the lower to the upper.
    """

    log_gain: float
    variance: float
    weights: Floats
    law_variance: float
    neighbours: tuple[int, int]
    share: float


@dataclass(frozen=True)
class GainTable:
    """The measured gains, looked up by setting.

    ``wiggle_draw`` shifts interpolated gains by that many of the law's own errors: calibrations
    drawn for Monte Carlo differ in it.
    """

    settings: tuple[float, ...]
    log_gain: Floats
    covariance: Floats
    wiggle_draw: float = 0.0

    @cached_property
    def law(self) -> GainLaw | None:
        """The law that describes the points best; None with fewer than 3 settings."""
        return fit_law(np.array(self.settings), self.log_gain, self.covariance)

    def at(self, setting: float) -> GainAt:
        """Give the gain at a calibrated setting, or between two of them where the law allows.

        Between two settings the law carries the shape, the points on both sides the level.

        Raises
        ------
        SettingError
            For any other setting, naming those there are.
        """
        settings = np.array(self.settings)
        weights = np.zeros(settings.size)
        nearest = int(np.argmin(np.abs(settings - setting)))
        if abs(settings[nearest] - setting) <= 1e-9 * max(1.0, abs(setting)):
            weights[nearest] = 1.0
            variance = float(self.covariance[nearest, nearest])
            return GainAt(float(self.log_gain[nearest]), variance, weights, 0.0, (nearest, nearest), 0.0)
        law = self._law_for(setting)
        upper = int(np.searchsorted(settings, setting))
        share = float((setting - settings[upper - 1]) / (settings[upper] - settings[upper - 1]))
        weights[upper - 1], weights[upper] = 1.0 - share, share
        rest = self.log_gain - law.log_gain(settings)
        value = float(law.log_gain(setting) + weights @ rest) + self.wiggle_draw * law.wiggle
        variance = float(weights @ self.covariance @ weights) + law.wiggle**2
        return GainAt(value, variance, weights, law.wiggle**2, (upper - 1, upper), share)

    def _law_for(self, setting: float) -> GainLaw:
        known = f"calibrated settings: {', '.join(f'{item:g}' for item in self.settings)}"
        if not min(self.settings) < setting < max(self.settings):
            raise SettingError(f"gain {setting:g} was not calibrated; {known}")
        if self.law is None or len(self.settings) < FEWEST_SETTINGS:
            raise SettingError(
                f"gain {setting:g} was not calibrated, and {len(self.settings)} settings are too few "
                f"to interpolate between ({FEWEST_SETTINGS} needed); {known}"
            )
        if not self.law.supported:
            raise SettingError(
                f"gain {setting:g} was not calibrated, and no law describes the measured gains to "
                f"{LARGEST_WIGGLE:.0%} (the best misses them by {self.law.wiggle:.0%}); {known}"
            )
        return self.law
