"""What belongs to one gain setting of a calibrated camera, and the words for its figures and flags."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Map = NDArray[np.float32]


class Flag(IntFlag):
    """Why a pixel's energy is missing or to be taken with care."""

    BAD = 1
    SATURATED = 2
    ABOVE_RANGE = 4
    BELOW_RANGE = 8


class Figure(NamedTuple):
    """One figure of merit: value with statistical and systematic standard uncertainty."""

    name: str
    setting: float
    value: float
    stderr: float
    systematic: float
    unit: str


@dataclass(frozen=True)
class Setting:
    """What belongs to one gain setting: pixel maps and noise.

    Attributes
    ----------
    dark, flat : Map
        Dark level of each pixel, counts; relative sensitivity of each pixel.
    dark_stderr, flat_stderr : float
        Statistical standard errors of one pixel of them (counts; relative).
    read_variance : float
        Dark temporal variance of one pixel, counts squared.
    shot : float
        Variance of the light's noise per exposure (the noise module's kappa).
    correlation : Floats
        Correlation of the light's noise between pixels against distance.
    """

    dark: Map
    flat: Map
    dark_stderr: float
    flat_stderr: float
    read_variance: float
    shot: float
    correlation: Floats

    def mixed_with(self, other: Setting, share: float) -> Setting:
        """Give the setting between this one and ``other``, ``share`` of the way."""
        names = ("dark_stderr", "flat_stderr", "read_variance", "correlation")
        return Setting(
            dark=_mixed(self.dark, other.dark, share),
            flat=_mixed(self.flat, other.flat, share),
            shot=float(self.shot ** (1.0 - share) * other.shot**share),
            **{name: (1.0 - share) * getattr(self, name) + share * getattr(other, name) for name in names},
        )


def _mixed(low: Map, high: Map, share: float) -> Map:
    return low if low is high else np.asarray((1.0 - share) * low + share * high, dtype=np.float32)
