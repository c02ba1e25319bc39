"""Expected estimator: walks from the laser that score the chance of reaching the aperture.

Works with every surface and every receiver. Backscatter is joined from the camera's side, because next
events see its forward peaks too seldom. Light that no water scatters is not left to chance: from
diffuse surfaces it is computed by quadrature, from glossy ones each pixel is sampled in turn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from imclab.optics.surface import MICROFACET
from imclab.transport.backscatter_walk import backscatter_walks, way_home
from imclab.transport.direct_light import coverage_of, direct_light, finer, rules_for
from imclab.transport.next_event import DIFFUSE_LAST, mirror_light, next_event_walks
from imclab.transport.picture_grid import PictureGrid, picture_grid
from imclab.transport.runner import Estimator, Tally
from imclab.transport.setup import PULSE_REACH, Setup, first_return
from imclab.transport.smooth_map import smooth_map

FloatArray = NDArray[np.float64]

BATCH_SIZE = 20_000


def make(setup: Setup) -> Estimator:
    """Return the expected estimator of a set-up."""
    grid = picture_grid(setup)
    coverage = coverage_of(setup.target.mask, *grid.cells)
    direct = direct_light(setup, rules_for(setup), coverage, np.zeros(1), 1, finer(setup, grid.cells))
    exact = {"target": grid.pixels(direct.picture), "backscatter": np.zeros(grid.shape)}
    if setup.time.bins:
        exact["time"] = direct.times
    latest = setup.gate.closes + PULSE_REACH * setup.gate.sigma
    glossy, veil, home = glossy_pixels(setup, grid), smooth_map(setup), way_home(setup, latest)
    scatters = setup.water.scattering > 0.0

    def batch(seed: int, first_history: int, count: int) -> Tally:
        target, times = np.zeros(grid.shape), np.zeros(setup.time.bins)
        backscatter = np.zeros(veil.shape)
        run = (np.uint64(seed), np.uint64(first_history), count)
        if scatters:
            next_event_walks(setup, DIFFUSE_LAST, latest, *run, target, times)
            backscatter_walks(setup, home, latest, veil.tents, *run, backscatter, times)
        if glossy.size:
            mirror_light(setup, glossy, *run, target, times)
        tally = {"backscatter": veil.picture(backscatter), "target": target}
        return tally | {"time": times} if setup.time.bins else tally

    return Estimator("expected", batch, BATCH_SIZE, exact, left_out(setup))


def glossy_pixels(setup: Setup, grid: PictureGrid) -> NDArray[np.int64]:
    """Return the numbers, row by row, of the pixels that have any glossy surface."""
    figure = coverage_of(setup.target.mask, *grid.shape)
    shares = np.zeros(grid.shape)
    if setup.target.figure.kind == MICROFACET:
        shares += figure
    if setup.target.ground.kind == MICROFACET:
        shares += np.clip(1.0 - figure, 0.0, 1.0)
    return np.flatnonzero(shares > 0.0)


def left_out(setup: Setup) -> tuple[str, ...]:
    """Say what a scene spares the run."""
    notes = ["light that no water scatters is computed for diffuse surfaces, not sampled"]
    if setup.water.scattering == 0.0:
        notes.append("no walks: the water does not scatter")
    elif np.isfinite(setup.gate.closes):
        notes.append("walks end when they can no longer arrive before the gate closes")
    if setup.gate.closes + PULSE_REACH * setup.gate.sigma <= first_return(setup):
        notes.append("no walks for the target: the gate closes before any of its light returns")
    if not setup.time.bins:
        notes.append("no time histogram: not asked for")
    return tuple(notes)
