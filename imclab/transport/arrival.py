"""What a picture with hardly any light should tell: a gate beside the target's return, or no photon at all.

The pulse has no end: a gate that opens long after the target's light still gets the share of a
Gaussian's tail, and light that took long detours. Such a number stays what it is, because estimators are
held against one another there, but it is told what it means.
"""

from __future__ import annotations

import math

from imclab.scene import Scene
from imclab.transport.setup import PULSE_REACH, Setup, target_return

FEWEST_PHOTONS = 1e-3
"""Less than this a pulse over the whole picture is nothing: one photon in a thousand pulses."""
NOTHING = "nothing arrived"
_PLANCK_TIMES_LIGHT = 6.62607015e-34 * 299792458.0


def gate_beside_target(scene: Scene, setup: Setup) -> tuple[str, ...]:
    """Return a note when the gate is shut for the whole of the target's direct light."""
    gate, returns = setup.gate, target_return(scene, setup.water.group_velocity)
    reach = PULSE_REACH * gate.sigma
    if gate.opens <= returns + reach and gate.closes >= returns - reach:
        return ()
    return (
        f"the gate is open from {1e9 * gate.opens:.4g} to {1e9 * gate.closes:.4g} ns, but the target's light "
        f'comes back at {1e9 * returns:.4g} ns: the target is not seen. [gate] center = "target" finds it',
    )


def nothing_arrived(scene: Scene, total: float) -> tuple[str, ...]:
    """Return a note when the picture's energy ``total`` (J a pulse) is less than one photon can be."""
    photons = total * scene.laser.wavelength / _PLANCK_TIMES_LIGHT
    if photons >= FEWEST_PHOTONS or math.isnan(photons):
        return ()
    return (f"{NOTHING}: {total:.2g} J is less than one photon in a thousand pulses",)
