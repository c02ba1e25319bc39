"""The estimators by name, and the choice that ``auto`` makes."""

from __future__ import annotations

from dataclasses import replace

from imclab.errors import Fault, InputError
from imclab.optics.surface import MICROFACET
from imclab.transport import analog, two_sided
from imclab.transport.runner import Estimator
from imclab.transport.setup import Setup

MAKERS = {"analog": analog.make, "two-sided": two_sided.make}


def choose(name: str, setup: Setup) -> Estimator:
    """Return the estimator of a name; ``auto`` takes the one that suits the set-up and notes why."""
    if name == "auto":
        chosen, reason = _suitable(setup)
        made = MAKERS[chosen](setup)
        return replace(made, notes=(f"estimator {chosen}: {reason}", *made.notes))
    if name not in MAKERS:
        raise InputError("simulate", [Fault("estimator", repr(name), ", ".join(["auto", *MAKERS]))])
    return MAKERS[name](setup)


def _suitable(setup: Setup) -> tuple[str, str]:
    if MICROFACET in (setup.target.figure.kind, setup.target.ground.kind):
        return "analog", "a glossy surface sends light back in a narrow lobe"
    return "two-sided", "both surfaces send light back with the same radiance everywhere"
