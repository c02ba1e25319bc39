"""The water of a scene as the kernels take it: coefficients, speed of the pulse, phase function."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from imclab.media import Medium
from imclab.optics import phase
from imclab.optics.phase_table import PhaseTable
from imclab.scene import Scene
from imclab.transport.scattering import HenyeyGreensteinLaw

SPEED_OF_LIGHT = 299_792_458.0


class Water(NamedTuple):
    """Attenuation, absorption and scattering (1/m), albedo, phase index, speed of the pulse (m/s)."""

    attenuation: float
    absorption: float
    scattering: float
    albedo: float
    refractive_index: float
    group_velocity: float
