"""Scene inputs with an uncertainty: the same scene with one of them moved, or all of them drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imclab import units
from imclab.errors import Fault, InputError
from imclab.scene import Scene

Spreads = Mapping[str, str | float]
"""Standard uncertainties by the dotted path of a scene's key."""


def moved_by_its_uncertainty(scene: Scene, dotted: str, spread: str | float) -> Scene:
    """Return ``scene`` with the value at ``dotted`` raised by ``spread``.

    Parameters
    ----------
    dotted : str
        Path of a key that the scene gives, such as ``"medium.attenuation"``.
    spread : str or float
        Standard uncertainty: text with a unit when the value is one, else a number.

    Raises
    ------
    InputError
        When the scene does not give the key, or value and spread are not of one kind.
    """
    return moved_together(scene, {dotted: spread}, [1.0])


def moved_together(scene: Scene, spreads: Spreads, steps: Sequence[float] | NDArray[np.float64]) -> Scene:
    """Return ``scene`` with every input moved by its own number of standard uncertainties.

    Parameters
    ----------
    spreads : mapping
        Standard uncertainties by dotted path, each as in `moved_by_its_uncertainty`.
    steps : sequence of float
        How many of them each input moves, in the same order.

    Raises
    ------
    InputError
        As `moved_by_its_uncertainty`; also when the moved values make no scene.
    """
    pairs = zip(spreads.items(), steps, strict=True)
    return scene.with_(**{dotted: _moved(scene, dotted, spread, step) for (dotted, spread), step in pairs})


def joint_steps(common: Sequence[bool], *, conditions: int, draws: int, seed: int) -> NDArray[np.float64]:
    """Draw how many standard uncertainties each input is off, for Monte Carlo propagation (JCGM 101).

    Normal and independent, as a centred Latin hypercube: every draw takes the middle of another one of
    ``draws`` equally probable slices of each input, in random order. Their spread is within 1.2 % of
    the normal law's from ten draws on, where ten plain draws are wrong by a quarter.

    Parameters
    ----------
    common : sequence of bool
        For each input, whether its error is one for all conditions.

    Returns
    -------
    array (draws, conditions, inputs)
    """
    from scipy.special import ndtri
    from scipy.stats import qmc

    shared = np.asarray(common, dtype=bool)
    if draws == 0:
        return np.empty((0, conditions, shared.size))
    own = int((~shared).sum())
    sampler = qmc.LatinHypercube(
        d=int(shared.sum()) + own * conditions, scramble=False, rng=np.random.default_rng(seed)
    )
    normal = ndtri(sampler.random(draws))
    steps = np.empty((draws, conditions, shared.size))
    steps[:, :, shared] = normal[:, np.newaxis, : shared.sum()]
    steps[:, :, ~shared] = normal[:, shared.sum() :].reshape(draws, conditions, own)
    return steps


def _moved(scene: Scene, dotted: str, spread: str | float, step: float) -> str | float:
    value: Any = scene.document
    for key in dotted.split("."):
        value = value.get(key) if isinstance(value, dict) else None
    try:
        if isinstance(value, str) and isinstance(spread, str):
            return units.sum_of(value, spread, times=float(step))
        if isinstance(value, (int, float)) and isinstance(spread, (int, float)):
            return float(value + step * spread)
        raise units.UnitError(f"wanted an uncertainty of the same kind as the scene's value {value!r}")
    except units.UnitError as error:
        fault = Fault(f"uncertainty.{dotted}", repr(spread), str(error).removeprefix("wanted "))
        raise InputError("experiment", [fault]) from None
