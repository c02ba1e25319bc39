"""The phase functions, all behind the interface of `PhaseFunction`."""

from imclab.optics.fournier_forand import FournierForand
from imclab.optics.phase_closed import HenyeyGreenstein, Isotropic, Rayleigh
from imclab.optics.phase_function import PhaseFunction
from imclab.optics.phase_mixture import Mixture, TwoTermHenyeyGreenstein
from imclab.optics.phase_table import PhaseTable

__all__ = [
    "FournierForand",
    "HenyeyGreenstein",
    "Isotropic",
    "Mixture",
    "PhaseFunction",
    "PhaseTable",
    "Rayleigh",
    "TwoTermHenyeyGreenstein",
]
