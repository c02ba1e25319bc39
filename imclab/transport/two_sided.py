"""Two-sided estimator: light on the target from the laser's side joined with walks from the camera.

The picture is a sum of parts, by what the light has met on the target last:

- a diffuse surface (Lambertian, diffuse law), unscattered both ways: computed by quadrature;
- a diffuse surface, scattered before it only: walks from the laser (`light_walk`), seen unscattered;
- a diffuse surface, scattered after it: walks from the camera (`camera_walk`), which end on the target
  lit by both;
- a glossy surface, unscattered both ways: each pixel is sampled in turn (`next_event.mirror_light`);
- a glossy surface, scattered: walks from the camera that are reflected and joined with the beam
  (`glossy_walk`), and the laser's image in the target seen through the water (`mirror_veil`); where the beam
  is narrower than the target, walks from the laser with next events (`next_event`);
- nothing: walks from the camera joined with the beam (`backscatter_walk`).

Light and camera walks meet batch by batch. Both sides of a batch are independent, so the mean of their
product is exact, and the spread of batches is its error.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from imclab.optics.surface import MICROFACET
from imclab.transport.backscatter_walk import backscatter_walks, way_home
from imclab.transport.camera_walk import camera_walks
from imclab.transport.direct_light import coverage_of, direct_light, finer, nodes_reached, rules_for
from imclab.transport.expected import glossy_pixels, left_out
from imclab.transport.glossy_walk import glossy_walks, mirrored_walks, roughnesses
from imclab.transport.light_walk import LightMaps, MapAxes, light_walks
from imclab.transport.mirror_veil import mirror_veil
from imclab.transport.next_event import GLOSSY_LAST, mirror_light, next_event_walks
from imclab.transport.picture_grid import picture_grid
from imclab.transport.runner import Estimator, Tally
from imclab.transport.setup import PULSE_REACH, Setup, first_return
from imclab.transport.smooth_map import smooth_map
from imclab.transport.swung_walk import collisions_swung, swung_walks
from imclab.transport.target_radiance import gate_matrix, gate_table, gated_radiance, map_axes
from imclab.transport.two_sided_times import rings_seen, scattered_times

FloatArray = NDArray[np.float64]

BATCH_SIZE = 16_384
"""A power of 2, for which Sobol's points are most even."""
WALKS_SWUNG_PER_OTHER = 4
PACKETS_PER_VEIL = 32
"""A place of the mirror's veil serves thousands of pixels and costs as much as tens of walks."""
VEIL_WALKS_PER_PACKET = 2


def light_maps(
    setup: Setup, axes: MapAxes, swung: int, latest: float, run: tuple[np.uint64, np.uint64, int]
) -> LightMaps:
    """Return the maps of scattered light on the target per packet, from walks of both kinds."""
    seed, first, count = run
    if not swung:
        return LightMaps(*(part / max(count, 1) for part in light_walks(setup, axes, 0, latest, *run)))
    few = -(-count // WALKS_SWUNG_PER_OTHER)
    others = light_walks(setup, axes, swung, latest, seed, first, few)
    swings = swung_walks(setup, axes, latest, *run)
    pairs = zip(swings, others, strict=True)
    return LightMaps(*(a / max(count, 1) + b / max(few, 1) for a, b in pairs))


def scattered_glossy(
    setup: Setup,
    glossy: NDArray[np.int64],
    roughness: tuple[float, float],
    peak: float,
    latest: float,
    run: tuple[np.uint64, np.uint64, int],
    picture: FloatArray,
    times: FloatArray,
) -> None:
    """Add the scattered light that has met a glossy surface last: three kinds, each with its own walks."""
    seed, first, count = run
    mirrored_walks(setup, glossy, roughness, peak, latest, *run, picture, times)
    many, few = VEIL_WALKS_PER_PACKET * count, -(-count // PACKETS_PER_VEIL)
    start = first * np.uint64(VEIL_WALKS_PER_PACKET)
    part, parted = np.zeros_like(picture), np.zeros_like(times)
    glossy_walks(setup, roughness, peak, latest, seed, start, many, part, parted)
    picture += part / VEIL_WALKS_PER_PACKET
    times += parted / VEIL_WALKS_PER_PACKET
    part[:], parted[:] = 0.0, 0.0
    mirror_veil(setup, roughness, latest, seed, first, few, part, parted)
    picture += part * (count / max(few, 1))
    times += parted * (count / max(few, 1))


def make(setup: Setup) -> Estimator:
    """Return the two-sided estimator of a set-up."""
    grid, veil = picture_grid(setup), smooth_map(setup)
    coverage = coverage_of(setup.target.mask, *grid.cells)
    latest = setup.gate.closes + PULSE_REACH * setup.gate.sigma
    axes = map_axes(setup, latest)
    reached = nodes_reached(setup, axes.times)
    direct = direct_light(setup, rules_for(setup), coverage, axes.times, reached, finer(setup, grid.cells))
    exact = {"target": grid.pixels(direct.picture), "backscatter": np.zeros(grid.shape)}
    if setup.time.bins:
        exact["time"] = direct.times
    swung = collisions_swung(setup)
    table, home, glossy = gate_table(setup, axes, direct), way_home(setup, latest), glossy_pixels(setup, grid)
    shares, roughness = gate_matrix(setup, axes), roughnesses(setup)
    unscattered = rings_seen(setup, axes, direct, coverage)
    veil_every = 2 if np.isfinite(latest) else 1  # a gate leaves little backscatter
    returns = latest > first_return(setup)
    scatters, shiny = setup.water.scattering > 0.0, returns and glossy.size > 0
    diffuse = returns and {setup.target.figure.kind, setup.target.ground.kind} != {MICROFACET}

    def batch(seed: int, first_history: int, count: int) -> Tally:
        cells, backscatter = np.zeros_like(coverage), np.zeros(veil.shape)
        mirrored, times = np.zeros(grid.shape), np.zeros(setup.time.bins)
        run = (np.uint64(seed), np.uint64(first_history), count)
        if scatters and diffuse:
            maps = light_maps(setup, axes, swung, latest, run)
            rings = shares @ maps.impulses
            radiance, seen = gated_radiance(setup, axes, table, direct, coverage, rings, maps.late)
            camera = camera_walks(setup, axes, direct, coverage, radiance, *run)
            cells = count * seen + camera.picture
            if setup.time.bins:
                seen_rings = unscattered + camera.impulses / max(count, 1)
                arriving = maps.impulses + maps.late_impulses
                times += camera.times + count * scattered_times(setup, axes, arriving, seen_rings)
        if scatters:
            few, veiled = -(-count // veil_every), np.zeros(setup.time.bins)
            backscatter_walks(setup, home, latest, veil.tents, *run[:2], few, backscatter, veiled)
            backscatter *= count / max(few, 1)
            times += veiled * (count / max(few, 1))
        if scatters and shiny:
            if swung:
                scattered_glossy(setup, glossy, roughness, home.peak, latest, run, mirrored, times)
            else:  # rays back from the target would seldom meet a narrow beam
                next_event_walks(setup, GLOSSY_LAST, latest, *run, mirrored, times)
        if shiny:
            mirror_light(setup, glossy, *run, mirrored, times)
        tally = {"target": grid.pixels(cells) + mirrored, "backscatter": veil.picture(backscatter)}
        return tally | {"time": times} if setup.time.bins else tally

    return Estimator("two-sided", batch, BATCH_SIZE, exact, left_out(setup))
