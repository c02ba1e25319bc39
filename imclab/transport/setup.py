"""A scene as the kernels take it: one border where everything is cast, checked and made contiguous.

Behind this border kernels trust their input: SI units, float64, group velocity instead of index,
half widths instead of full ones, standard deviations instead of full widths at half maximum.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imclab.errors import Fault, InputError
from imclab.optics.phase_table import PhaseTable
from imclab.optics.reflection import Surface
from imclab.scene import Scene
from imclab.transport.materials import surface_of
from imclab.transport.media import Water, water_of
from imclab.transport.scattering import HenyeyGreensteinLaw

FWHM_PER_SIGMA = 2.0 * math.sqrt(2.0 * math.log(2.0))
TEN_TO_NINETY_PER_SIGMA = 2.0 * 1.2815515655446004
"""Rise time from 10 to 90 % of an edge whose shape is a Gaussian's integral, in standard deviations."""
PULSE_REACH = 6.0
"""Standard deviations of the pulse after which it is over: the share beyond is 1e-9."""
IMPULSE_BINS_PER_BIN, IMPULSE_BINS_PER_SIGMA, MOST_IMPULSE_BINS = 8, 8, 4000
FOLLOWED_RETURNS = 2.0
"""Without a gate the time histogram reaches from 0 to so many times the target's return."""


class Beam(NamedTuple):
    """Standard deviations of the start point (m) and of the polar angle's Rayleigh law (rad)."""

    spot_sigma: float
    divergence_sigma: float


class Target(NamedTuple):
    """Rectangle in the plane z = distance; ``mask`` is 1 where the figure is, shape (rows, columns)."""

    distance: float
    half_width: float
    half_height: float
    mask: NDArray[np.uint8]
    figure: Surface
    ground: Surface


class Receiver(NamedTuple):
    """Disc aperture facing +z; the picture's pixels divide the target's rectangle."""

    x: float
    y: float
    z: float
    radius: float
    cos_half_view: float
    columns: int
    rows: int


class Gate(NamedTuple):
    """Open from ``opens`` to ``closes`` (s); ``sigma`` joins pulse and rise time, both Gaussian."""

    opens: float
    closes: float
    sigma: float


class TimeBins(NamedTuple):
    """Even bins of the arrival time of the pulse's peak; ``bins`` 0 leaves them out."""

    start: float
    width: float
    bins: int


class Setup(NamedTuple):
    """Everything that a kernel of a picture needs to know."""

    water: Water
    phase: HenyeyGreensteinLaw | PhaseTable
    beam: Beam
    target: Target
    receiver: Receiver
    gate: Gate
    time: TimeBins


def setup_of(scene: Scene, *, time_bins: int = 0) -> Setup:
    """Cast a scene for the kernels.

    Parameters
    ----------
    scene : Scene
    time_bins : int
        Bins of the time histogram that the result shall have; the kernels tally finer ones.

    Raises
    ------
    InputError
        When the receiver stands behind the water's surface or beyond the target.
    """
    water, phase = water_of(scene)
    target, receiver = _target_of(scene, water.refractive_index), _receiver_of(scene)
    gate = _gate_of(scene, water.group_velocity)
    start, end = time_window(scene, gate, water.group_velocity)
    sigma = pulse_sigma(scene)
    first, last = start - PULSE_REACH * sigma, end + PULSE_REACH * sigma
    by_pulse = min(math.ceil((last - first) / sigma * IMPULSE_BINS_PER_SIGMA), MOST_IMPULSE_BINS)
    count = max(time_bins * IMPULSE_BINS_PER_BIN, by_pulse) if time_bins else 0
    bins = TimeBins(first, (last - first) / max(count, 1), count)
    return Setup(water, phase, beam_of(scene, water.refractive_index), target, receiver, gate, bins)


def pulse_sigma(scene: Scene) -> float:
    """Return the standard deviation of the pulse in time, s."""
    return scene.laser.pulse_fwhm / FWHM_PER_SIGMA


def time_window(scene: Scene, gate: Gate, group_velocity: float) -> tuple[float, float]:
    """Return first and last edge of the time histogram: the gate, or all up to twice the target's return."""
    if math.isfinite(gate.opens):
        return gate.opens, gate.closes
    return 0.0, FOLLOWED_RETURNS * target_return(scene, group_velocity)


def target_return(scene: Scene, group_velocity: float) -> float:
    """Return when the pulse's peak comes back from the target's centre to the receiver, s."""
    x, y, z = scene.receiver.position
    distance = scene.target.distance
    return (distance + math.hypot(x, y, distance - z)) / group_velocity


def first_return(setup: Setup) -> float:
    """Return when the pulse's peak can come back from the target at the earliest, s."""
    target, receiver = setup.target, setup.receiver
    return (2.0 * target.distance - receiver.z) / setup.water.group_velocity


def beam_of(scene: Scene, refractive_index: float) -> Beam:
    """Return the beam inside the water.

    A divergence measured in air is refracted once, by a flat window: Snell's law for the ray at half
    the full width.
    """
    divergence = scene.laser.divergence_fwhm
    if scene.laser.divergence_measured_in == "air":
        divergence = 2.0 * math.asin(math.sin(min(divergence / 2.0, math.pi / 2.0)) / refractive_index)
    return Beam(scene.laser.spot_fwhm / FWHM_PER_SIGMA, divergence / FWHM_PER_SIGMA)


def _target_of(scene: Scene, refractive_index: float) -> Target:
    target, wavelength = scene.target, scene.laser.wavelength
    figure = surface_of(target.figure, refractive_index, wavelength)
    ground = figure if target.ground is None else surface_of(target.ground, refractive_index, wavelength)
    mask = np.ascontiguousarray(scene.figure_mask, dtype=np.uint8)
    return Target(target.distance, target.width / 2.0, target.height / 2.0, mask, figure, ground)


def _receiver_of(scene: Scene) -> Receiver:
    receiver = scene.receiver
    x, y, z = receiver.position
    if not 0.0 <= z < scene.target.distance:
        fault = Fault(
            "receiver.position", f"z = {z:g} m", f"0 m to below target.distance = {scene.target.distance:g} m"
        )
        raise InputError("scene", [fault])
    columns, rows = receiver.pixels
    cosine = math.cos(receiver.field_of_view / 2.0)
    return Receiver(x, y, z, receiver.aperture_radius, cosine, columns, rows)


def _gate_of(scene: Scene, group_velocity: float) -> Gate:
    sigma = pulse_sigma(scene)
    if scene.gate is None:
        return Gate(-math.inf, math.inf, sigma)
    opens = scene.gate.delay
    if opens is None:
        opens = target_return(scene, group_velocity) - scene.gate.width / 2.0
    rise_sigma = scene.gate.rise / TEN_TO_NINETY_PER_SIGMA
    return Gate(opens, opens + scene.gate.width, math.hypot(sigma, rise_sigma))
