from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import imclab
from imclab.transport import two_sided
from imclab.transport.setup import PULSE_REACH, setup_of
from imclab.transport.target_radiance import FEWEST_STEPS_PER_SIGMA, MOST_TIMES, map_axes
from tests.imaging_scenes import CENTRED, scene

SLIT = Path(__file__).parents[3] / "data" / "scenes" / "lambertian_slit.toml"


@pytest.mark.parametrize("gate", [CENTRED, {"delay": "25 ns", "width": "3 ns"}], ids=["on", "late"])
def test_camera_times_are_fine_enough_for_the_pulse(gate: dict[str, str]) -> None:
    """Of 64 nodes the last steps behind a late gate were a whole standard deviation of the pulse."""
    setup = setup_of(scene(1.0, gate=gate))
    latest = setup.gate.closes + PULSE_REACH * setup.gate.sigma
    times = map_axes(setup, latest).times
    assert 64 <= times.size <= MOST_TIMES
    assert np.diff(times).max() <= 1.001 * setup.gate.sigma / FEWEST_STEPS_PER_SIGMA
    assert times[-1] >= latest - setup.target.distance / setup.water.group_velocity


def test_no_batch_has_a_bright_square() -> None:
    """Light that comes back to the target is rare: one walk once raised 66 pixels by 19 standard deviations.

    Of a million normal numbers the largest is 4.9 standard deviations; pixels of a batch are not quite
    normal.
    """
    open_gate = setup_of(imclab.load_scene(SLIT).with_(**{"medium.attenuation": "1.42 1/m"}))
    gate = open_gate.gate._replace(opens=-math.inf, closes=math.inf)
    estimator = two_sided.make(open_gate._replace(gate=gate))
    size = estimator.batch_size
    pictures = np.array([estimator.batch(1, i * size, size)["target"] for i in range(48)])
    deviation = pictures.std(axis=0, ddof=1)
    typical = np.median(deviation / pictures.mean(axis=0)) * pictures.mean(axis=0)
    assert ((pictures - pictures.mean(axis=0)) / typical).max() < 10.0
