"""Complex indices of the metals that targets are plated with, at 532 nm, from the packaged table."""

from __future__ import annotations

from imclab.optics.limits import check, refuse
from imclab.optics.tables import rows

_SYMBOL = {"silver": "Ag", "nickel": "Ni"}
DEFAULT_SET = "Johnson"


def metal_index(name: str, wavelength: float = 532e-9, *, data_set: str = DEFAULT_SET) -> complex:
    """Return the index n - ik of a metal against vacuum.

    Parameters
    ----------
    name : {"silver", "nickel"}
        The metal.
    wavelength : float
        In m; the table holds 532 nm alone, used from 527 to 537 nm.
    data_set : str
        Measurement in the table: "Johnson" (Johnson & Christy 1972, 1974), for silver also "Jiang",
        "McPeak", and "Rakic-LD" for both. Sets of one metal differ: nickel in water reflects 0.517 to
        0.555.

    Raises
    ------
    InputError
        An unknown metal or set, or another wavelength.
    """
    if name not in _SYMBOL:
        raise refuse("metal", repr(name), " or ".join(_SYMBOL), advice="Give the index itself instead")
    check("wavelength", wavelength * 1e9, 527.0, 537.0, unit="nm; give the index itself elsewhere")
    sets = {row["set"]: row for row in rows("metals_index_532nm") if row["metal"] == _SYMBOL[name]}
    if data_set not in sets:
        raise refuse("data set", repr(data_set), ", ".join(sets))
    return complex(float(sets[data_set]["n"]), -float(sets[data_set]["k"]))
