"""What the report says beside the comparison: calibration, gate, where everything came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Entry:
    """One line of a table: a name and a number with its unit, or a text.

    ``stderr`` is the standard uncertainty, in the same unit. Numbers of one name that differ by a
    setting (of the intensifier) stand in one line, a column for each setting.
    """

    name: str
    value: float | int | str
    unit: str = ""
    stderr: float | None = None
    setting: str = ""


@dataclass(frozen=True)
class Curve:
    """A measured curve with its standard error, and what its axes are (with units)."""

    x: FloatArray
    y: FloatArray
    stderr: FloatArray
    x_label: str
    y_label: str


@dataclass(frozen=True, kw_only=True)
class Context:
    """Everything on the page that does not follow from the comparison itself.

    Texts must hold no absolute path and no machine's name.

    Attributes
    ----------
    calibration : tuple of Entry
        Summary of the camera's calibration.
    response, gain : Curve, optional
        Counts against energy, and relative gain against the gain setting.
    gates : mapping of (float, float)
        For each condition, when its gate opens and closes, s after the pulse's peak enters the water.
    modelled : tuple of str
        What the simulation holds, one sentence each. What it leaves out is in each result's notes.
    provenance : tuple of Entry
        Versions, digests of the input files, seeds.
    commands : tuple of str
        That make the report again.
    """

    calibration: tuple[Entry, ...] = ()
    response: Curve | None = None
    gain: Curve | None = None
    gates: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    modelled: tuple[str, ...] = ()
    provenance: tuple[Entry, ...] = ()
    commands: tuple[str, ...] = ()
