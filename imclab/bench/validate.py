"""What a kernel has to get right before it is timed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from imclab.bench.scenes import slab_scene
from imclab.errors import ImclabError
from imclab.transport import transmit

WORST_Z = 5.0
# van de Hulst 1980, table 35 (g 0.75, albedo 0.9, optical depth 2, no surface), to more digits
SLAB_TRANSMITTED, SLAB_REFLECTED = 0.660957700162, 0.097394638671


class WrongKernelError(ImclabError):
    """A kernel failed validation, so nothing of it is timed."""


@dataclass(frozen=True)
class Check:
    """One comparison: its name and by how many standard errors it missed."""

    name: str
    z: float


def forward_checks(seed: int) -> list[Check]:
    """Hold the forward engine against a slab known to ten digits, and against Beer and Lambert."""
    flux = transmit(slab_scene(2.0, albedo=0.9, asymmetry=0.75), packets=2e5, seed=seed, threads=1)
    clear = transmit(slab_scene(1.42, albedo=0.0, asymmetry=0.75), packets=100, seed=seed, threads=1)
    beer = abs(clear.transmitted[0] / math.exp(-1.42) - 1.0)
    balance = abs(flux.transmitted[-1] + flux.reflected[-1] + flux.absorbed - 1.0)
    return [
        Check(
            "slab, transmitted",
            float((flux.transmitted[0] - SLAB_TRANSMITTED) / flux.transmitted_stderr[0]),
        ),
        Check("slab, reflected", float((flux.reflected[0] - SLAB_REFLECTED) / flux.reflected_stderr[0])),
        Check("Beer and Lambert, in units of 1e-6", float(beer / 1e-6)),
        Check("energy balance, in units of 1e-6", float(balance / 1e-6)),
    ]


def refuse_wrong(checks: list[Check]) -> None:
    """Raise `WrongKernelError` with every check that failed."""
    failed = [check for check in checks if not abs(check.z) <= WORST_Z]
    if failed:
        told = "; ".join(f"{check.name}: {check.z:+.1f} standard errors" for check in failed)
        raise WrongKernelError(f"not timed, because it is wrong: {told}")
