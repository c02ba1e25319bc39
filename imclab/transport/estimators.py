"""The estimators by name, and the choice that ``auto`` makes."""

from __future__ import annotations

from dataclasses import replace

from imclab.errors import Fault, InputError
from imclab.optics.surface import MICROFACET
from imclab.transport import analog, expected, two_sided
from imclab.transport.runner import Estimator
from imclab.transport.scattering import HenyeyGreensteinLaw
from imclab.transport.setup import Setup

MAKERS = {"analog": analog.make, "expected": expected.make, "two-sided": two_sided.make}


def choose(name: str, setup: Setup) -> Estimator:
    """Return the estimator of a name; ``auto`` takes the one that suits the set-up and notes why."""
    if name == "auto":
        chosen, reason = _suitable(setup)
        made = MAKERS[chosen](setup)
        return replace(made, notes=(f"estimator {chosen}: {reason}", *made.notes))
    if name not in MAKERS:
        raise InputError("simulate", [Fault("estimator", repr(name), ", ".join(["auto", *MAKERS]))])
    if name != "analog" and _scatters_straight_back(setup):
        wanted = "analog or auto: what is scattered straight back cannot be joined with the beam, only met"
        raise InputError("simulate", [Fault("estimator", f"{name} with g = -1", wanted)])
    return MAKERS[name](setup)


def _scatters_straight_back(setup: Setup) -> bool:
    law = setup.phase
    return isinstance(law, HenyeyGreensteinLaw) and law.asymmetry <= -1.0 and setup.water.scattering > 0.0


def _suitable(setup: Setup) -> tuple[str, str]:
    if _scatters_straight_back(setup):
        return "analog", "light scattered straight back (g = -1) cannot be joined with the beam, only met"
    kinds = {setup.target.figure.kind, setup.target.ground.kind}
    if kinds == {MICROFACET}:
        return "two-sided", "light of the glossy target and backscatter from the camera's side"
    if MICROFACET in kinds:
        return (
            "two-sided",
            "a diffuse surface is joined from both sides, the glossy one seen from the camera's",
        )
    return "two-sided", "a diffuse target is lit from the laser's side and seen from the camera's"
