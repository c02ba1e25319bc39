"""Phase functions from measured tables, and Petzold's among them.

Between two angles the table is a power law of the angle (a straight line on log-log paper), below the
first angle it goes on as a power law, beyond the last one it stays as it is. Its integrals are exact
for that curve: Gauss quadrature inside every interval, and the pole at 0 degrees analytically.

Symbols: theta scattering angle in rad, ``s = 1 - mu``, F the probability below an angle.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.optics.limits import check, refuse
from imclab.optics.phase_function import PhaseFunction
from imclab.optics.tables import rows

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_LAST_ANGLE_MAY_MISS = np.radians(10.0)


@dataclass(frozen=True, eq=False)
class Tabulated(PhaseFunction):
    """A phase function given by its values at some angles.

    Parameters
    ----------
    angles : array_like
        Scattering angles in rad, strictly increasing, from 0 or above to 170 degrees or above.
    values : array_like
        Values there, positive, in any unit; they are normalised.
    forward_slope : float, optional
        Power of the angle below the first one, above -2; the slope between the first two when left
        out.

    Attributes
    ----------
    scale : float
        What the values were divided by: the integral of the table over the sphere. For a volume
        scattering function in 1/(m sr) it is the scattering coefficient.

    Raises
    ------
    InputError
        The angles are not increasing, a value is not positive, or the integral is infinite.
    """

    angles: ArrayLike
    values: ArrayLike
    forward_slope: float | None = None
    scale: float = field(init=False)

    def __post_init__(self) -> None:
        theta = np.array(self.angles, dtype=np.float64)
        value = np.array(self.values, dtype=np.float64)
        _check_table(theta, value)
        # The power law needs a first angle above 0; a value at 0 holds up to a tenth of the next angle.
        if theta[0] == 0.0:
            theta[0] = 0.1 * theta[1]
            slope = 0.0 if self.forward_slope is None else self.forward_slope
        else:
            steps = np.log(value[:2]), np.log(theta[:2])
            own = float((steps[0][1] - steps[0][0]) / (steps[1][1] - steps[1][0]))
            slope = own if self.forward_slope is None else self.forward_slope
        if not slope > -2.0:
            wanted = "a slope above -2: a steeper pole has no finite integral"
            raise refuse("slope toward 0 degrees", f"{slope:.3g}", wanted)
        if theta[-1] < np.pi:
            theta, value = np.append(theta, np.pi), np.append(value, value[-1])
        self._set(theta, value, slope)

    def _set(self, theta: Array, value: Array, slope: float) -> None:
        between = np.diff(np.log(value)) / np.diff(np.log(theta))
        for array in (theta, value, between):
            array.flags.writeable = False
        attributes = {"_theta": theta, "_value": value, "_between": between, "_slope": slope}
        for name, content in attributes.items():
            object.__setattr__(self, name, content)
        # The cumulative integral at the angles of the table, before normalisation.
        object.__setattr__(self, "scale", 1.0)
        object.__setattr__(self, "_below", np.zeros(theta.size))
        first = self._pole(theta[:1])
        pieces = self._inside(np.arange(theta.size - 1), theta[1:])
        below = np.concatenate((first, first + np.cumsum(pieces)))
        object.__setattr__(self, "scale", float(below[-1]))
        object.__setattr__(self, "_below", below)

    _theta: Array = field(init=False, repr=False)
    _value: Array = field(init=False, repr=False)
    _between: Array = field(init=False, repr=False)
    _below: Array = field(init=False, repr=False)
    _slope: float = field(init=False, repr=False)

    def _curve(self, theta: Array) -> Array:
        """Table before normalisation at angles in rad."""
        interval = np.clip(np.searchsorted(self._theta, theta, side="right") - 1, 0, self._between.size - 1)
        power = np.where(theta < self._theta[0], self._slope, self._between[interval])
        ratio = np.maximum(theta, 1e-30) / self._theta[interval]
        return np.asarray(self._value[interval] * ratio**power)

    def _pole(self, theta: Array) -> Array:
        """Integral from 0 to angles within the first: power law times sin(theta), the pole taken out."""
        exponent = 2.0 + self._slope
        share = (0.5 * (1.0 + _NODES)) ** (1.0 / exponent)
        sinc = np.sinc(theta[..., None] * share / np.pi) @ (0.5 * _WEIGHTS)
        first = self._theta[0]
        power = self._value[0] * first**2 * (theta / first) ** exponent / exponent
        return np.asarray(2.0 * np.pi * power * sinc)

    def _inside(self, interval: NDArray[np.int64], theta: Array) -> Array:
        """Integral from the start of each interval to an angle in it."""
        start = self._theta[interval]
        half = 0.5 * (theta - start)
        points = (start + half)[..., None] + half[..., None] * _NODES
        law = (
            self._value[interval][..., None]
            * (points / start[..., None]) ** self._between[interval][..., None]
        )
        return np.asarray(2.0 * np.pi * half * ((law * np.sin(points)) @ _WEIGHTS))

    def density(self, s: Array) -> Array:
        """Phase function in 1/sr at ``s = 1 - mu``."""
        return self._curve(_angle(s)) / self.scale

    def forward_probability(self, s: Array) -> Array:
        """Probability of ``1 - mu'`` at most s."""
        theta = np.minimum(_angle(s), np.pi)
        interval = np.clip(np.searchsorted(self._theta, theta, side="right") - 1, 0, self._between.size - 1)
        inside = self._below[interval] + self._inside(interval, np.maximum(theta, self._theta[0]))
        value = np.where(theta < self._theta[0], self._pole(np.minimum(theta, self._theta[0])), inside)
        return np.asarray(value / self.scale)

    def backward_probability(self, r: Array) -> Array:
        """Probability of ``1 + mu'`` at most r."""
        return np.asarray(1.0 - self.forward_probability(2.0 - np.asarray(r, dtype=np.float64)))


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
