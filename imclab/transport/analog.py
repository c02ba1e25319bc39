"""The paper's flow chart to the letter: each packet is followed until one of four terminations.

A packet starts in the beam (eqs. 1, 2), moves by free paths (eq. 3), scatters with the albedo as its
loss (eq. 19, section 2), is put back on the target's plane when it has passed it (eq. 13), reflected
there (eqs. 8-12), and gathered where it crosses the receiver's plane (eq. 14). It ends

1. gathered by the receiver within its aperture and field of view;
2. on the target's plane outside the target;
3. with less energy than a threshold, or, what the paper leaves out, through the water's surface;
4. after the greatest number of scatterings.

Nothing here is clever. It is the truth that faster estimators are held against, so both biases of the
chart are made too small to see: threshold 1e-9 of a packet, 100,000 scatterings.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imclab.transport.gathering import gate_share, pixel_of, time_bin
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.random import uniforms
from imclab.transport.runner import Estimator, Tally
from imclab.transport.scattering import sample_deviation, turn
from imclab.transport.setup import Setup
from imclab.transport.surfaces import sample as sample_surface

BATCH_SIZE = 20_000
LEAST_WEIGHT = 1e-9
MOST_EVENTS = 100_000
ENDLESS = 1e30
"""A free path (m) that stands for water without attenuation; finite, because inf times 0 is no number."""

_LAUNCH, _WALK, _REFLECT = 0, 1, 2
"""Streams of random numbers: what the three kinds of events of one history draw from."""


def make(setup: Setup) -> Estimator:
    """Return the analog estimator of a set-up."""
    rows, columns = setup.receiver.rows, setup.receiver.columns

    def batch(seed: int, first_history: int, count: int) -> Tally:
        pictures = np.zeros((2, rows, columns))
        times = np.zeros(setup.time.bins)
        _follow(setup, np.uint64(seed), np.uint64(first_history), count, pictures, times)
        tally = {"backscatter": pictures[0], "target": pictures[1]}
        return tally | {"time": times} if setup.time.bins else tally

    return Estimator("analog", batch, BATCH_SIZE)


@device
def launch(beam: Any, seed: Any, history: Any) -> Any:
    """Return start point and direction of a packet (eqs. 1, 2): normal in x and y, Rayleigh in angle."""
    u0, u1, u2, u3 = uniforms(seed, history, 0, _LAUNCH)
    radius = beam.spot_sigma * math.sqrt(-2.0 * math.log(u0))
    polar = min(beam.divergence_sigma * math.sqrt(-2.0 * math.log(u2)), math.pi)
    place, azimuth = 2.0 * math.pi * u1, 2.0 * math.pi * u3
    sine = math.sin(polar)
    return (
        (radius * math.cos(place), radius * math.sin(place), 0.0),
        (sine * math.cos(azimuth), sine * math.sin(azimuth), math.cos(polar)),
    )


@device
def reflect(target: Any, point: Any, direction: Any, draw: Any) -> Any:
    """Return a reflected direction and the factor of energy at a point of the target's rectangle.

    ``draw`` is (seed, history, event). The surface's own normal +z points back toward the laser, so z
    changes sign on the way in and out.
    """
    surface = surface_at(target, point)
    u0, u1, _, _ = uniforms(draw[0], draw[1], draw[2], _REFLECT)
    leaving, factor = sample_surface(surface, (-direction[0], -direction[1], direction[2]), u0, u1)
    return (leaving[0], leaving[1], -leaving[2]), factor


@device
def surface_at(target: Any, point: Any) -> Any:
    """Return the surface, figure or ground, at a point inside the target's rectangle."""
    rows, columns = target.mask.shape
    row = min(int((point[1] + target.half_height) / (2.0 * target.half_height) * rows), rows - 1)
    column = min(int((point[0] + target.half_width) / (2.0 * target.half_width) * columns), columns - 1)
    return target.figure if target.mask[row, column] else target.ground


@cached_kernel
def _follow(
    setup: Any,
    seed: Any,
    first_history: Any,
    count: int,
    pictures: NDArray[np.float64],
    times: NDArray[np.float64],
) -> None:
    """Follow ``count`` packets; pictures[1] gathers light that has touched the target, pictures[0] other."""
    water, target, receiver = setup.water, setup.target, setup.receiver
    mean_free_path = 1.0 / max(water.attenuation, 1.0 / ENDLESS)
    for i in range(count):
        history = first_history + np.uint64(i)
        (x, y, z), (dx, dy, dz) = launch(setup.beam, seed, history)
        weight, path, touched = 1.0, 0.0, 0
        for event in range(MOST_EVENTS):  # termination 4
            u0, u1, u2, _ = uniforms(seed, history, event, _WALK)
            step = -math.log(u0) * mean_free_path
            if z + step * dz >= target.distance:
                step = (target.distance - z) / dz
                x, y, z = x + step * dx, y + step * dy, target.distance  # eq. 13
                path += step
                if abs(x) >= target.half_width or abs(y) >= target.half_height:
                    break  # termination 2
                (dx, dy, dz), factor = reflect(target, (x, y), (dx, dy, dz), (seed, history, event))
                weight, touched = weight * factor, 1
                if weight <= LEAST_WEIGHT:
                    break  # termination 3
                continue
            if z > receiver.z >= z + step * dz:
                back = (receiver.z - z) / dz
                point = (x + back * dx, y + back * dy)
                if _accepts(receiver, point, dz):
                    _gather(setup, (point, (dx, dy, dz)), (path + back, weight), pictures[touched], times)
                    break  # termination 1
            x, y, z = x + step * dx, y + step * dy, z + step * dz
            path += step
            weight *= water.albedo
            if z <= 0.0 or weight <= LEAST_WEIGHT:
                break  # left the water; termination 3
            sine, cosine = math.sin(2.0 * math.pi * u2), math.cos(2.0 * math.pi * u2)
            dx, dy, dz = turn((dx, dy, dz), sample_deviation(setup.phase, u1), sine, cosine)


@device
def _accepts(receiver: Any, point: Any, dz: Any) -> Any:
    """Tell whether a ray through the receiver's plane is inside disc and half field of view (eq. 14)."""
    across, down = point[0] - receiver.x, point[1] - receiver.y
    return across * across + down * down <= receiver.radius**2 and -dz >= receiver.cos_half_view


@device
def _gather(setup: Any, ray: Any, packet: Any, picture: Any, times: Any) -> None:
    (point, direction), (path, weight) = ray, packet
    row, column = pixel_of(setup, point, direction)
    if row < 0:
        return
    arrival = path / setup.water.group_velocity
    picture[row, column] += weight * gate_share(setup.gate, arrival)
    bin_ = time_bin(setup.time, arrival)
    if bin_ >= 0:
        times[bin_] += weight
