"""`transmit`: what crosses planes of water one way, and how far beam and pulse have spread there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imclab.errors import Fault, InputError
from imclab.provenance import versions
from imclab.result import Flux
from imclab.scene import Scene

if TYPE_CHECKING:
    from imclab.transport.runner import Reached, Tally

FloatArray = NDArray[np.float64]

MOST_PLANES = 200


def transmit(
    scene: Scene,
    *,
    packets: float | None = None,
    seconds: float | None = None,
    rel_error: float | None = None,
    distances: Iterable[float] | None = None,
    seed: int | None = None,
    threads: int | None = None,
    progress: Callable[[Reached], None] | None = None,
) -> Flux:
    """Return what crosses planes of water for the first time, and what comes back from before them.

    Each plane is taken as if the water ended there. Light that is never scattered is computed.

    Parameters
    ----------
    scene : Scene
        Its water and laser; target, receiver and gate play no part.
    packets, seconds, rel_error : float, optional
        When to stop, at the first of those given; else as the scene's ``[run]`` says, else at a
        relative error of 0.01. ``packets`` counts emitted packets, those computed included;
        ``rel_error`` is the largest of the transmitted and reflected shares.
    distances : iterable of float, optional
        Where the planes stand, m; the target's distance when left out. Sorted in the result.
    seed : int, optional
        The random numbers follow from it and from nothing else.
    threads : int, optional
        As many as the process may use when left out.
    progress : callable, optional
        Called with a ``Reached`` after each batch.

    Returns
    -------
    Flux
        After Ctrl-C what was finished, with ``interrupted`` set.

    Raises
    ------
    InputError
        For arguments out of range.
    """
    from imclab.transport import oneway
    from imclab.transport.groups import GroupLedger
    from imclab.transport.media import water_of
    from imclab.transport.request import check_threads, limits, seed_of
    from imclab.transport.runner import run
    from imclab.transport.setup import beam_of, pulse_sigma

    planes = _planes([scene.target.distance] if distances is None else distances)
    until = limits(scene, rel_error=rel_error, seconds=seconds, packets=packets)
    used_seed = seed_of(scene, seed)
    check_threads(threads)
    water, phase = water_of(scene)
    beam, sigma = beam_of(scene, water.refractive_index), pulse_sigma(scene)
    # the pulse's length, and the detour of the beam's outer rays
    delay_scale = sigma * water.group_velocity + planes[-1] * min(beam.divergence_sigma, 1.0) ** 2
    estimator, sampled_share = oneway.make(
        water, phase, beam, planes=planes.tolist(), delay_scale=delay_scale
    )
    ledger = GroupLedger(estimator.exact, sampled_share=sampled_share, stop_at="moments")
    effort = run(estimator, ledger, until, seed=used_seed, threads=threads, progress=progress)

    quantities = _quantities(
        planes,
        sigma,
        water.group_velocity,
        radial_scale=oneway.radial_scale_of(beam, planes[-1]),
        delay_scale=delay_scale,
    )
    value, stderr = ledger.jackknife(quantities)
    fields = {}
    for name, column, error in zip(_COLUMNS, value.T, stderr.T, strict=True):
        fields[name], fields[f"{name}_stderr"] = column, error
    absorbed, absorbed_stderr = ledger.jackknife(lambda means: means["absorbed"])
    return Flux(
        distances=planes,
        **fields,
        absorbed=float(absorbed[0]),
        absorbed_stderr=float(absorbed_stderr[0]),
        scene=scene.toml,
        seed=used_seed,
        packets=effort.packets,
        cpu_seconds=effort.cpu_seconds,
        wall_seconds=effort.wall_seconds,
        threads=effort.threads,
        notes=estimator.notes + effort.notes,
        interrupted=effort.interrupted,
        versions=versions(),
    )


def _planes(distances: Iterable[float]) -> FloatArray:
    planes = np.unique(np.asarray(list(distances), dtype=np.float64))
    if not 1 <= planes.size <= MOST_PLANES:
        raise InputError("transmit", [Fault("distances", f"{planes.size}", f"1 to {MOST_PLANES} distances")])
    if not (np.isfinite(planes).all() and planes[0] > 0.0):
        raise InputError("transmit", [Fault("distances", f"{planes.tolist()}", "metres above 0")])
    return planes


_COLUMNS = (
    "transmitted",
    "reflected",
    "spot_fwhm",
    "spot_rms",
    "pulse_fwhm",
    "pulse_rms",
    "mean_path",
    "reflected_mean_path",
)


def _quantities(
    planes: FloatArray, sigma: float, group_velocity: float, *, radial_scale: float, delay_scale: float
) -> Callable[[Tally], FloatArray]:
    """Return the function that turns means per packet into the quantities, shape (planes, quantities)."""
    from imclab.transport.oneway import delay_edges, radial_edges
    from imclab.transport.widths import pulse_fwhm, spot_fwhm

    edges = radial_edges(radial_scale)
    # the last bin has no end; what lies in it, far behind the pulse, is left out of the width
    bin_sigma = np.diff(delay_edges(delay_scale)[:-1]) / (math.sqrt(12.0) * group_velocity)
    smeared = np.hypot(sigma, bin_sigma)
    count = planes.size

    def quantities(means: Tally) -> FloatArray:
        through, back = means["moments"][:count], np.cumsum(means["moments"][count:], axis=0)
        rows = []
        for k, distance in enumerate(planes):
            weight, square, excess, excess_square = through[k]
            returned, _, returned_path, _ = back[k]
            mean_excess = excess / weight if weight > 0.0 else math.nan
            variance = excess_square / weight - mean_excess**2 if weight > 0.0 else math.nan
            shares, paths = means["delay"][k]
            delays = paths / np.where(shares > 0.0, shares, 1.0) / group_velocity
            rows.append(
                [
                    weight,
                    returned,
                    spot_fwhm(edges, means["radial"][k]),
                    math.sqrt(square / weight) if weight > 0.0 else math.nan,
                    pulse_fwhm(delays[:-1], shares[:-1], smeared),
                    math.sqrt(sigma**2 + max(variance, 0.0) / group_velocity**2),
                    distance + mean_excess,
                    returned_path / returned if returned > 0.0 else math.nan,
                ]
            )
        return np.array(rows)

    return quantities
