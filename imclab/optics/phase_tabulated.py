"""Phase functions from measured tables, and Petzold's among them.

Between two angles the table is a power law of the angle (a straight line on log-log paper), below the
first angle it goes on as a power law, beyond the last one it stays as it is. Its integrals are exact
for that curve: Gauss quadrature inside every interval, and the pole at 0 degrees analytically.

Symbols: theta scattering angle in rad, ``s = 1 - mu``, F the probability below an angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.optics.limits import check, refuse
from imclab.optics.phase_function import PhaseFunction
from imclab.optics.tables import rows

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_LAST_ANGLE_MAY_MISS = np.radians(10.0)


@dataclass(frozen=True, eq=False)
class _PowerLaws:
    """A curve over the scattering angle made of power laws, from one angle above 0 to 180 degrees.

    ``slope`` is the power below the first angle.
    """

    theta: Array
    value: Array
    slope: float

    @cached_property
    def powers(self) -> Array:
        """Power of the angle in every interval."""
        return np.asarray(np.diff(np.log(self.value)) / np.diff(np.log(self.theta)))

    @cached_property
    def below(self) -> Array:
        """Integral over the sphere from 0 to each angle."""
        pieces = self._inside(np.arange(self.powers.size), self.theta[1:])
        return np.cumsum(np.concatenate((self._pole(self.theta[:1]), pieces)))

    def at(self, theta: Array) -> Array:
        """Value at each angle."""
        interval = self._interval(theta)
        power = np.where(theta < self.theta[0], self.slope, self.powers[interval])
        ratio = np.maximum(theta, 1e-30) / self.theta[interval]
        return np.asarray(self.value[interval] * ratio**power)

    def integral(self, theta: Array) -> Array:
        """Integral over the sphere from 0 to each angle."""
        first, interval = self.theta[0], self._interval(theta)
        beyond = self.below[interval] + self._inside(interval, np.maximum(theta, first))
        return np.where(theta < first, self._pole(np.minimum(theta, first)), beyond)

    def _interval(self, theta: Array) -> NDArray[np.int64]:
        return np.clip(np.searchsorted(self.theta, theta, side="right") - 1, 0, self.powers.size - 1)

    def _pole(self, theta: Array) -> Array:
        """Integral to angles within the first: in theta**(2 + slope) what remains is sin(x) / x."""
        exponent = 2.0 + self.slope
        share = (0.5 * (1.0 + _NODES)) ** (1.0 / exponent)
        sinc = np.sinc(theta[..., None] * share / np.pi) @ (0.5 * _WEIGHTS)
        scale = 2.0 * np.pi * self.value[0] * self.theta[0] ** 2 / exponent
        return np.asarray(scale * (theta / self.theta[0]) ** exponent * sinc)

    def _inside(self, interval: NDArray[np.int64], theta: Array) -> Array:
        """Integral from the start of each interval to an angle in it."""
        start = self.theta[interval]
        half = 0.5 * (theta - start)
        points = (start + half)[..., None] + half[..., None] * _NODES
        power = self.powers[interval][..., None]
        law = self.value[interval][..., None] * (points / start[..., None]) ** power
        return np.asarray(2.0 * np.pi * half * ((law * np.sin(points)) @ _WEIGHTS))


@dataclass(frozen=True, eq=False)
class Tabulated(PhaseFunction):
    """A phase function given by its values at some angles.

    Parameters
    ----------
    angles : array_like
        Scattering angles in rad, strictly increasing, from 0 or above to 170 degrees or above. A value
        at 0 holds up to a tenth of the next angle.
    values : array_like
        Values there, positive, in any unit; they are normalised.
    forward_slope : float, optional
        Power of the angle below the first one, above -2; the slope between the first two when left
        out, none if the first angle is 0.

    Raises
    ------
    InputError
        The angles are not increasing, a value is not positive, or the integral is infinite.
    """

    angles: ArrayLike
    values: ArrayLike
    forward_slope: float | None = None

    def __post_init__(self) -> None:
        theta = np.array(self.angles, dtype=np.float64)
        value = np.array(self.values, dtype=np.float64)
        _check_table(theta, value)
        for name, array in (("angles", theta), ("values", value)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if not self._curve.slope > -2.0:
            wanted = "a slope above -2: a steeper pole has no finite integral"
            raise refuse("slope toward 0 degrees", f"{self._curve.slope:.3g}", wanted)

    @cached_property
    def _curve(self) -> _PowerLaws:
        theta, value = np.array(self.angles), np.array(self.values)
        own_slope = 0.0
        if theta[0] == 0.0:
            theta[0] = 0.1 * theta[1]
        else:
            own_slope = float(np.log(value[1] / value[0]) / np.log(theta[1] / theta[0]))
        if theta[-1] < np.pi:
            theta, value = np.append(theta, np.pi), np.append(value, value[-1])
        return _PowerLaws(theta, value, own_slope if self.forward_slope is None else self.forward_slope)

    @property
    def scale(self) -> float:
        """Integral of the table over the sphere, by which the values are divided.

        For a volume scattering function in 1/(m sr) it is the scattering coefficient.
        """
        return float(self._curve.below[-1])

    def density(self, s: Array) -> Array:
        """Phase function in 1/sr at ``s = 1 - mu``."""
        return self._curve.at(_angle(s)) / self.scale

    def forward_probability(self, s: Array) -> Array:
        """Probability of ``1 - mu'`` at most s."""
        return self._curve.integral(_angle(s)) / self.scale

    def backward_probability(self, r: Array) -> Array:
        """Probability of ``1 + mu'`` at most r."""
        return 1.0 - self.forward_probability(2.0 - np.asarray(r, dtype=np.float64))


def _angle(s: ArrayLike) -> Array:
    """Scattering angle in rad; ``sin(theta/2)`` keeps the digits of small ones."""
    half = np.sqrt(np.clip(0.5 * np.asarray(s, dtype=np.float64), 0.0, 1.0))
    return np.asarray(2.0 * np.arcsin(half))


def _check_table(theta: Array, value: Array) -> None:
    if theta.ndim != 1 or theta.shape != value.shape or theta.size < 2:
        raise refuse(
            "table", f"shapes {theta.shape} and {value.shape}", "two columns of equal length, 2 rows or more"
        )
    check("angles", theta, 0.0, np.pi * (1.0 + 1e-12), unit="rad")
    backward = np.flatnonzero(np.diff(theta) <= 0.0)
    if backward.size:
        row = int(backward[0]) + 1
        raise refuse(
            f"angles[{row}]", f"{theta[row]:g} after {theta[row - 1]:g}", "strictly increasing angles"
        )
    bad = np.flatnonzero(~((value > 0.0) & np.isfinite(value)))
    if bad.size:
        raise refuse(f"values[{bad[0]}]", f"{value[bad[0]]:g}", "positive finite numbers")
    if theta[-1] < np.pi - _LAST_ANGLE_MAY_MISS:
        came = f"{np.degrees(theta[-1]):.4g} deg"
        raise refuse("last angle", came, "170 to 180 deg: backscatter cannot be guessed")


PETZOLD_NAMES = (
    "average",
    "AUTEC_7",
    "AUTEC_8",
    "AUTEC_9",
    "HAOCE_5",
    "HAOCE_11",
    "NUC_2200",
    "NUC_2040",
    "NUC_2240",
)


def petzold(name: str = "average") -> Tabulated:
    """Return one of Petzold's phase functions at 530 nm.

    Parameters
    ----------
    name : str
        "average" for the average particle of Mobley et al. 1993, or a station: water and particles
        together. AUTEC_8, HAOCE_11 and NUC_2040 are known as clear, coastal and turbid.

    Notes
    -----
    Below 0.1 degrees nothing was measured; the power law of the source goes on there, and 3 to 15 % of
    the scattering lies there.
    """
    if name not in PETZOLD_NAMES:
        raise refuse("Petzold's phase function", repr(name), ", ".join(PETZOLD_NAMES))
    column, station = ("average_particle_per_sr", "average_particle") if name == "average" else (name, name)
    table = rows("petzold_vsf")
    slopes = {row["station"]: float(row["slope_below_0.1deg"]) for row in rows("petzold_stations")}
    return Tabulated(
        np.radians([float(row["angle_deg"]) for row in table]),
        [float(row[column]) for row in table],
        forward_slope=slopes[station],
    )
