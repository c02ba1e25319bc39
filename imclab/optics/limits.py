"""One way to refuse a value outside its range: what it is, what came, what is allowed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from imclab.errors import Fault, InputError


def refuse(name: str, came: object, wanted: str, *, advice: str = "") -> InputError:
    """Return the error for one value, ready to raise.

    Parameters
    ----------
    name : str
        What the value is.
    came : object
        What was given.
    wanted : str
        The allowed range or form.
    advice : str
        The next step, if there is one to give.
    """
    return InputError("optics", [Fault(name, str(came), wanted, advice)])


def check(
    name: str, value: ArrayLike, low: float, high: float, *, unit: str = "", open_low: bool = False
) -> None:
    """Refuse NaN and everything outside ``low`` to ``high``; the first offender is named.

    Parameters
    ----------
    name : str
        What the value is.
    value : float or array
        What was given.
    low, high : float
        The allowed range, ends included.
    unit : str
        Shown behind the range.
    open_low : bool
        Exclude ``low`` itself.

    Raises
    ------
    InputError
        A value lies outside or is not a number.
    """
    values = np.asarray(value, dtype=np.float64)
    inside = (values > low if open_low else values >= low) & (values <= high)
    if np.all(inside):
        return
    came = values[~inside].ravel()[0]
    start = f"above {low:g}" if open_low else f"{low:g}"
    wanted = f"{start} and up" if high == np.inf else f"{start} to {high:g}"
    raise refuse(name, f"{came:g}", f"{wanted} {unit}".rstrip())
