"""The phase functions, all behind the interface of `PhaseFunction`."""

from imclab.optics.fournier_forand import FournierForand
from imclab.optics.phase_closed import HenyeyGreenstein, Isotropic, Rayleigh
from imclab.optics.phase_function import PhaseFunction
from imclab.optics.phase_mie import Mie
from imclab.optics.phase_mixture import Mixture, TwoTermHenyeyGreenstein
from imclab.optics.phase_table import PhaseTable
from imclab.optics.phase_tabulated import PETZOLD_NAMES, Tabulated, petzold

__all__ = [
    "PETZOLD_NAMES",
    "FournierForand",
    "HenyeyGreenstein",
    "Isotropic",
    "Mie",
    "Mixture",
    "PhaseFunction",
    "PhaseTable",
    "Rayleigh",
    "Tabulated",
    "TwoTermHenyeyGreenstein",
    "petzold",
]
