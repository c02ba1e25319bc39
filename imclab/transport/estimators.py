"""The estimators by name, and the choice that ``auto`` makes."""

from __future__ import annotations

from imclab.errors import Fault, InputError
from imclab.transport import analog
from imclab.transport.runner import Estimator
from imclab.transport.setup import Setup

MAKERS = {"analog": analog.make}


def choose(name: str, setup: Setup) -> Estimator:
    """Return the estimator of a name; ``auto`` takes the one that suits the set-up."""
    if name == "auto":
        name = "analog"
    if name not in MAKERS:
        raise InputError("simulate", [Fault("estimator", repr(name), ", ".join(["auto", *MAKERS]))])
    return MAKERS[name](setup)
