"""One-way runs of plain slabs, without the widths: what the physics tests of the forward engine share."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from imclab.transport import oneway
from imclab.transport.groups import GroupLedger
from imclab.transport.media import Water
from imclab.transport.runner import Until, run
from imclab.transport.scattering import HenyeyGreensteinLaw
from imclab.transport.setup import Beam

PENCIL = Beam(spot_sigma=1e-6, divergence_sigma=1e-7)


class SlabOutcome(NamedTuple):
    """Shares and mean paths, each a pair of value and standard error, per plane."""

    transmitted: Any
    reflected: Any
    transmitted_path: Any
    reflected_path: Any
    absorbed: Any
    mean_square_radius: Any
    estimator: Any


def water(attenuation: float, albedo: float) -> Water:
    return Water(attenuation, attenuation * (1.0 - albedo), attenuation * albedo, albedo, 1.0, 299_792_458.0)


def slab(
    attenuation: float,
    albedo: float,
    phase: Any,
    *,
    packets: int,
    planes: tuple[float, ...] = (1.0,),
    beam: Beam = PENCIL,
    seed: int = 1,
    threads: int = 1,
) -> SlabOutcome:
    """Send a beam through slabs of water of group index 1."""
    law = HenyeyGreensteinLaw(phase) if isinstance(phase, float) else phase
    estimator, share = oneway.make(
        water(attenuation, albedo), law, beam, planes=list(planes), delay_scale=planes[-1]
    )
    ledger = GroupLedger(estimator.exact, sampled_share=share, stop_at="moments")
    run(estimator, ledger, Until(packets=packets), seed=seed, threads=threads)
    count = len(planes)

    def through(means: Any) -> Any:
        return means["moments"][:count]

    def back(means: Any) -> Any:
        return np.cumsum(means["moments"][count:], axis=0)

    return SlabOutcome(
        ledger.jackknife(lambda m: through(m)[:, 0]),
        ledger.jackknife(lambda m: back(m)[:, 0]),
        ledger.jackknife(lambda m: np.array(planes) + through(m)[:, 2] / through(m)[:, 0]),
        ledger.jackknife(lambda m: back(m)[:, 2] / np.maximum(back(m)[:, 0], 1e-300)),
        ledger.jackknife(lambda m: m["absorbed"]),
        ledger.jackknife(lambda m: through(m)[:, 1] / through(m)[:, 0]),
        estimator,
    )
