"""Phase functions inside kernels, and how a direction turns.

A scattering is described by its *deviation* ``s = 1 - mu``, which keeps its digits where the cosine
``mu`` would be rounded to 1. The kind of phase function is the type of what travels in the set-up,
so each kernel is compiled for the one that its scene has.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import overload

from imclab.transport import phase_sampling
from imclab.transport.kernel_cache import device


class HenyeyGreensteinLaw(NamedTuple):
    """Henyey-Greenstein phase function in closed form; ``asymmetry`` 0 is isotropic."""

    asymmetry: float


def sample_deviation(phase: Any, u: Any) -> Any:
    """Draw a deviation from a phase function with one uniform number in (0, 1)."""
    raise NotImplementedError("called from kernels only")


def phase_density(phase: Any, deviation: Any) -> Any:
    """Return the phase function in 1/sr at a deviation."""
    raise NotImplementedError("called from kernels only")


@device
def henyey_greenstein_deviation(asymmetry: Any, u: Any, one: Any) -> Any:
    """Return the deviation that a uniform number stands for.

    The usual formula for the cosine with 1 - mu taken out by algebra: no cancellation near the
    forward direction, no division by the asymmetry, so it holds from -1 to 1 and through 0. ``one``
    is 1 in the precision wanted, because a literal would widen single precision to double.
    """
    narrow, wide = one - asymmetry, one + asymmetry
    d = wide - (asymmetry + asymmetry) * u
    return min(narrow * narrow * u * (wide + d) / (d * d), one + one)


def is_closed_form(phase: Any) -> bool:
    """Tell, while compiling, whether a phase function's numba type is the closed form."""
    return getattr(phase, "instance_class", None) is HenyeyGreensteinLaw


# Typing and implementation must agree in annotations too, so the implementations stand here by name.
def _sample_closed_form(phase: Any, u: Any) -> Any:
    return henyey_greenstein_deviation(phase.asymmetry, u, 1.0)


def _sample_table(phase: Any, u: Any) -> Any:
    return phase_sampling.sample(phase, u)


def _density_closed_form(phase: Any, deviation: Any) -> Any:
    g = phase.asymmetry
    square = (1.0 - g) * (1.0 - g) + 2.0 * g * deviation
    return (1.0 - g) * (1.0 + g) / (4.0 * math.pi * square * math.sqrt(square))


def _density_table(phase: Any, deviation: Any) -> Any:
    return phase_sampling.evaluate(phase, deviation)


@overload(sample_deviation)  # type: ignore[untyped-decorator]
def _sample_deviation(phase: Any, u: Any) -> Any:
    return _sample_closed_form if is_closed_form(phase) else _sample_table


@overload(phase_density)  # type: ignore[untyped-decorator]
def _phase_density(phase: Any, deviation: Any) -> Any:
    return _density_closed_form if is_closed_form(phase) else _density_table


@device
def turn(direction: Any, deviation: Any, sine_azimuth: Any, cosine_azimuth: Any) -> Any:
    """Return the unit direction at a deviation and an azimuth from a unit direction, in float64."""
    return turn_in(1.0, direction, deviation, sine_azimuth, cosine_azimuth)


@device
def turn_in(one: Any, direction: Any, deviation: Any, sine_azimuth: Any, cosine_azimuth: Any) -> Any:
    """Do what `turn` does in the precision of ``one``.

    Eq. 19 divides by sqrt(1 - u_z^2), which is zero along the axis. This basis has no such place and
    no branch (Duff et al. 2017, "Building an orthonormal basis, revisited", JCGT 6, 1). One step of
    Newton's method keeps the length at 1 over any number of turns, without a root or a division.
    """
    x, y, z = direction
    sign = one if z >= 0 else -one
    a = -one / (sign + z)
    b = x * y * a
    sine = math.sqrt(deviation * (one + one - deviation))
    along, across = sine * cosine_azimuth, sine * sine_azimuth
    forward = one - deviation
    new_x = forward * x + along * (one + sign * x * x * a) + across * b
    new_y = forward * y + along * sign * b + across * (sign + y * y * a)
    new_z = forward * z - along * sign * x - across * y
    half = one / (one + one)
    scale = one + half - half * (new_x * new_x + new_y * new_y + new_z * new_z)
    return new_x * scale, new_y * scale, new_z * scale
