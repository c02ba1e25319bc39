"""Pure water, sea water and Jerlov's water types: coefficients and indices, every number with a source.

Wavelengths are in vacuum, in m; temperatures in K; salinities in g/kg. Everything is refused outside
the range of its table or formula. Sources and checks: ``imclab/optics/tables/README.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.optics.limits import check, refuse
from imclab.optics.phase_closed import Rayleigh
from imclab.optics.tables import rows

Array = NDArray[np.float64]

ZERO_CELSIUS = 273.15
ROOM_TEMPERATURE = 293.15
DEPOLARISATION = 0.039
"""Depolarisation ratio of pure water (Farinato & Rowell 1976, used by Zhang, Hu & He 2009)."""

# Quan & Fry 1995, Appl. Opt. 34, 3477, eq. 3: T in deg C, S in permil, wavelength in nm.
_QUAN_FRY = (1.31405, 1.779e-4, -1.05e-6, 1.6e-8, -2.02e-6, 15.868, 0.01155, -0.00423, -4382.0, 1.1455e6)


@cache
def _column(table: str, name: str) -> Array:
    values = np.array([float(row[name]) for row in rows(table)])
    values.flags.writeable = False
    return values


def _nanometres(wavelength: ArrayLike, low: float, high: float) -> Array:
    # 7e-7 * 1e9 is above 700: a femtometre either way is no reason to refuse.
    wanted = np.round(np.asarray(wavelength, dtype=np.float64) * 1e9, 6)
    check("wavelength", wanted, low, high, unit="nm (in vacuum)")
    return np.asarray(wanted)


def absorption(
    wavelength: ArrayLike,
    *,
    temperature: float = ROOM_TEMPERATURE,
    salinity: float = 0.0,
    source: str = "wopp",
) -> Array:
    """Return the absorption coefficient of pure or sea water in 1/m.

    Parameters
    ----------
    wavelength : array_like
        In m, 380 to 730 nm ("wopp") or 380 to 727.5 nm ("pope-fry").
    temperature, salinity : float
        In K (0 to 40 deg C) and g/kg (0 to 40); the compilation's linear slopes are applied. Pope &
        Fry's table is of pure water at 22 deg C and takes neither.
    source : {"wopp", "pope-fry"}
        WOPP v3 (Roettgers 2016; below 510 nm Mason, Cone & Fry 2016) or Pope & Fry 1997.

    Raises
    ------
    InputError
        A value lies outside the range of the table.

    Notes
    -----
    Linear in wavelength between the table's 2 nm (2.5 nm). Leaving out every other row moves it by at
    most 2 % (4 %) from 450 to 650 nm, so the interpolation itself is good to about 1 %.
    """
    if source == "pope-fry":
        nm = _nanometres(wavelength, 380.0, 727.5)
        table = "water_absorption_popefry1997"
        return np.interp(nm, _column(table, "wavelength_nm"), _column(table, "a_per_m"))
    if source != "wopp":
        raise refuse("source", repr(source), '"wopp" or "pope-fry"')
    nm = _nanometres(wavelength, 380.0, 730.0)
    check("temperature", temperature - ZERO_CELSIUS, 0.0, 40.0, unit="deg C")
    check("salinity", salinity, 0.0, 40.0, unit="g/kg")
    table = "water_absorption_wopp_v3"
    grid = _column(table, "wavelength_nm")
    values = (
        _column(table, "a_per_m")
        + _column(table, "dadT") * (temperature - ROOM_TEMPERATURE)
        + _column(table, "dadS") * salinity
    )
    return np.interp(nm, grid, np.maximum(values, 0.0))


def scattering(wavelength: ArrayLike, *, salinity: float = 0.0) -> Array:
    """Return the scattering coefficient of pure or sea water at 20 deg C in 1/m.

    Parameters
    ----------
    wavelength : array_like
        In m, 380 to 730 nm.
    salinity : float
        In g/kg, 0 to 38.4.

    Notes
    -----
    Tabulated from Zhang, Hu & He 2009; power law between the wavelengths (error below 1e-4), linear
    between the salinities 0, 35 and 38.4 (error below 0.5 %). Between 0 and 30 deg C the true value moves
    by a few percent, which is not modelled.
    """
    table = "seawater_scattering"
    grid = _column(table, "wavelength_nm")
    nm = _nanometres(wavelength, float(grid[0]), float(grid[-1]))
    check("salinity", salinity, 0.0, 38.4, unit="g/kg")
    columns = [np.log(_column(table, f"b_S{name}_per_m")) for name in ("0", "35", "38.4")]
    at_salinity = [np.exp(np.interp(np.log(nm), np.log(grid), column)) for column in columns]
    low = 0 if salinity <= 35.0 else 1
    start, end = ((0.0, 35.0), (35.0, 38.4))[low]
    share = (salinity - start) / (end - start)
    return np.asarray((1.0 - share) * at_salinity[low] + share * at_salinity[low + 1])


def phase_function() -> Rayleigh:
    """Return the phase function of water itself, the same at all wavelengths and salinities."""
    return Rayleigh(DEPOLARISATION)


def refractive_index(
    wavelength: ArrayLike, *, temperature: float = ROOM_TEMPERATURE, salinity: float = 0.0
) -> Array:
    """Return the phase index of water against vacuum.

    Parameters
    ----------
    wavelength : array_like
        In m, 400 to 700 nm.
    temperature, salinity : float
        In K (0 to 30 deg C) and g/kg (0 to 40; fitted to 35, and linear in it), at atmospheric
        pressure.

    Notes
    -----
    Quan & Fry 1995 eq. 3, which is relative to air, times the index of dry air (Ciddor 1996). Within
    3e-5 of IAPWS R9-97 at 532 nm.
    """
    return _index_and_slope(wavelength, temperature, salinity)[0]


def group_index(
    wavelength: ArrayLike, *, temperature: float = ROOM_TEMPERATURE, salinity: float = 0.0
) -> Array:
    """Return the group index ``n - wavelength dn/dwavelength``, which sets the time of flight.

    Parameters as for `refractive_index`; the derivative is analytic.
    """
    index, slope = _index_and_slope(wavelength, temperature, salinity)
    return np.asarray(index - np.asarray(wavelength, dtype=np.float64) * 1e9 * slope)


def _index_and_slope(wavelength: ArrayLike, temperature: float, salinity: float) -> tuple[Array, Array]:
    """Phase index against vacuum and its slope per nm."""
    nm = _nanometres(wavelength, 400.0, 700.0)
    t = temperature - ZERO_CELSIUS
    check("temperature", t, 0.0, 30.0, unit="deg C")
    check("salinity", salinity, 0.0, 40.0, unit="g/kg")
    n0, n1, n2, n3, n4, n5, n6, n7, n8, n9 = _QUAN_FRY
    first = n5 + n6 * salinity + n7 * t
    water = n0 + (n1 + n2 * t + n3 * t * t) * salinity + n4 * t * t + first / nm + n8 / nm**2 + n9 / nm**3
    water_slope = -first / nm**2 - 2.0 * n8 / nm**3 - 3.0 * n9 / nm**4
    # Ciddor 1996, Appl. Opt. 35, 1566, eq. 1: standard dry air; w is the square of 1/wavelength in 1/um^2.
    w = (1e3 / nm) ** 2
    air = 1.0 + 1e-8 * (5792105.0 / (238.0185 - w) + 167917.0 / (57.362 - w))
    air_slope = 1e-8 * (5792105.0 / (238.0185 - w) ** 2 + 167917.0 / (57.362 - w) ** 2) * (-2.0 * w / nm)
    return np.asarray(water * air), np.asarray(water * air_slope + water_slope * air)


@dataclass(frozen=True)
class WaterType:
    """A natural water by its coefficients; the water itself is included.

    Attributes
    ----------
    name : str
        "pure water", or Jerlov's type: I, IA, IB, II, III (ocean), 1C, 3C, 5C, 7C, 9C (coast).
    source : str
        Where the coefficients come from.
    absorption, scattering : float
        a and b in 1/m.
    doubts : tuple of str
        What the table says against the values used, such as "suspect"; empty when nothing.
    """

    name: str
    source: str
    absorption: float
    scattering: float
    doubts: tuple[str, ...] = ()

    @property
    def attenuation(self) -> float:
        """``c = a + b`` in 1/m."""
        return self.absorption + self.scattering

    @property
    def albedo(self) -> float:
        """``b / c``."""
        return self.scattering / self.attenuation


def pure_water(
    wavelength: float, *, temperature: float = ROOM_TEMPERATURE, salinity: float = 0.0
) -> WaterType:
    """Return water with nothing in it but salt: `absorption` (WOPP) and `scattering` together."""
    return WaterType(
        name="pure water",
        source="WOPP v3; Zhang, Hu & He 2009",
        absorption=float(absorption(wavelength, temperature=temperature, salinity=salinity)),
        scattering=float(scattering(wavelength, salinity=salinity)),
    )


JERLOV_SOURCES = {
    "solonenko-2015": "jerlov_iop_solonenko2015",
    "williamson-2022": "jerlov_iop_williamson2022",
}
_PAPER = "paper"


def jerlov(name: str, wavelength: float, *, source: str = "solonenko-2015") -> WaterType:
    """Return one of Jerlov's water types at a wavelength.

    Parameters
    ----------
    name : str
        Jerlov's name of the type, such as "II".
    wavelength : float
        In m; 300 to 700 nm (solonenko-2015), 400 to 700 nm (williamson-2022).
    source : {"solonenko-2015", "williamson-2022", "paper"}
        Solonenko & Mobley 2015 have all ten types; Williamson & Hollins 2022 six. "paper" is type II at
        532 nm as the imaging paper prints it: c = 0.42 1/m, albedo 0.89.

    Raises
    ------
    InputError
        An unknown name or source, or a wavelength outside the table.

    Notes
    -----
    Linear between the wavelengths of the table, at most 25 nm apart. The sources differ by up to a
    factor of 4 in b.
    """
    if source == _PAPER:
        if name != "II":
            raise refuse("Jerlov type", repr(name), '"II", the only one the paper gives')
        check("wavelength", wavelength * 1e9, 531.0, 533.0, unit="nm (the paper's 532 nm)")
        return WaterType("II", _PAPER, absorption=0.42 * (1.0 - 0.89), scattering=0.42 * 0.89)
    if source not in JERLOV_SOURCES:
        raise refuse("source", repr(source), ", ".join([*JERLOV_SOURCES, _PAPER]))
    table = rows(JERLOV_SOURCES[source])
    names = list(dict.fromkeys(row["type"] for row in table))
    if name not in names:
        raise refuse("Jerlov type", repr(name), f"one of {', '.join(names)} (from {source})")
    own = [row for row in table if row["type"] == name and row["a_per_m"] and row["b_per_m"]]
    grid = np.array([float(row["wavelength_nm"]) for row in own])
    nm = float(_nanometres(wavelength, float(grid[0]), float(grid[-1])))
    right = min(int(np.searchsorted(grid, nm, side="right")), grid.size - 1)
    used = own[right - 1 : right + 1] if nm > grid[right - 1] else own[right - 1 : right]
    doubts = {row[f"status_{c}"] for row in used for c in "ab"} - {"ok"}
    a, b = (np.array([float(row[f"{c}_per_m"]) for row in own]) for c in "ab")
    return WaterType(
        name, source, float(np.interp(nm, grid, a)), float(np.interp(nm, grid, b)), tuple(sorted(doubts))
    )


def water_type(text: str, wavelength: float) -> WaterType:
    """Return the type that a scene names: "jerlov-II", or "jerlov-II paper" with a source.

    Parameters
    ----------
    text : str
        "jerlov-NAME", if wanted followed by a blank and a source of `jerlov`.
    wavelength : float
        In m.

    Raises
    ------
    InputError
        The text names no type, or as `jerlov`.
    """
    kind, _, rest = text.strip().partition("-")
    name, _, source = rest.partition(" ")
    if kind.lower() != "jerlov" or not name:
        raise refuse("water type", repr(text), '"jerlov-II", or "jerlov-II paper" with a source')
    known = {entry["type"].lower(): entry["type"] for entry in rows(JERLOV_SOURCES["solonenko-2015"])}
    return jerlov(known.get(name.lower(), name), wavelength, source=source.strip() or "solonenko-2015")
