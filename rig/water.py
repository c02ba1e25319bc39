"""The group index of water, for a gate planner that must run without the optics package.

Quan and Fry, Applied Optics 34, 3477 (1995), eq. 3, gives the index relative to air (0-30 degrees C,
0-40 g/kg, 400-700 nm); Ciddor, Applied Optics 35, 1566 (1996), eq. 1, the air's own. Light's time of
flight follows the group index n - lambda dn/dlambda of the two multiplied.
"""

from __future__ import annotations

from fractions import Fraction

from rig.errors import Fault, PlanError

TYPICAL_GROUP_INDEX = {"fresh": Fraction("1.357"), "sea": Fraction("1.364")}
"""At 532 nm and 20 degrees C; sea water of 35 g/kg."""

_WAVELENGTH_NM = (400.0, 700.0)
_TEMPERATURE_C = (0.0, 30.0)
_SALINITY = (0.0, 40.0)


def group_index(wavelength_nm: float, temperature_c: float, salinity: float) -> float:
    """Return the group index of water against vacuum.

    Parameters
    ----------
    wavelength_nm : float
        In vacuum, 400 to 700.
    temperature_c : float
        0 to 30.
    salinity : float
        g/kg, 0 to 40.

    Raises
    ------
    PlanError
        Outside the ranges of the measurements behind the formula.
    """
    faults = [
        Fault(name, f"{value:g}", f"{low:g} to {high:g} {unit}", "The formula was not measured there.")
        for name, value, (low, high), unit in (
            ("wavelength", wavelength_nm, _WAVELENGTH_NM, "nm"),
            ("temperature", temperature_c, _TEMPERATURE_C, "degrees C"),
            ("salinity", salinity, _SALINITY, "g/kg"),
        )
        if not low <= value <= high
    ]
    if faults:
        raise PlanError("group index of water", faults)
    w, t, s = wavelength_nm, temperature_c, salinity
    inverse = 15.868 + 0.01155 * s - 0.00423 * t
    relative = (
        1.31405
        + s * (1.779e-4 - 1.05e-6 * t + 1.6e-8 * t * t)
        - 2.02e-6 * t * t
        + inverse / w
        - 4382 / w**2
        + 1.1455e6 / w**3
    )
    relative_slope = -inverse / w**2 + 2 * 4382 / w**3 - 3 * 1.1455e6 / w**4
    squared_wavenumber = 1e6 / w**2  # 1/um^2
    first, second = 238.0185 - squared_wavenumber, 57.362 - squared_wavenumber
    air = 1 + 1e-8 * (5792105 / first + 167917 / second)
    air_slope = 1e-8 * (5792105 / first**2 + 167917 / second**2) * (-2 * squared_wavenumber / w)
    return relative * air - w * (relative_slope * air + relative * air_slope)
