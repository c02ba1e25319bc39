"""The motions as groups, and the sampling of pictures between pixels."""

import numpy as np
import pytest

from imclab.registration import sampling
from imclab.registration.motion import (
    PARAMETERS,
    Frame,
    displacements,
    distortion,
    moved,
    moved_back,
    parameters_between,
    simplified,
    stepped,
)

FRAME = Frame(90.0, 110.0, 40.0)
START = np.array([[1.05, -0.2, 12.0], [0.22, 0.98, -7.0], [2e-4, -1e-4, 1.0]])
STEP = np.array([0.03, -0.02, 0.05, 0.04, 0.02, -0.03, 0.01, 0.02])
POINTS = np.array([[0.0, 0.0], [199.0, 0.0], [60.0, 170.0]])


@pytest.mark.parametrize("count", PARAMETERS.values())
def test_steps_are_undone_by_the_parameters_between(count):
    there = stepped(START, STEP[:count], FRAME)
    found = parameters_between(START, there, FRAME)
    np.testing.assert_allclose(found[:count], STEP[:count], atol=1e-10)
    np.testing.assert_allclose(found[count:], 0, atol=1e-10)


def test_a_similarity_stays_one():
    there = stepped(np.eye(3), STEP[:4], FRAME)
    np.testing.assert_allclose(there[0, 0], there[1, 1])
    np.testing.assert_allclose(there[0, 1], -there[1, 0])
    np.testing.assert_allclose(distortion(there, FRAME), 0, atol=1e-12)
    assert np.abs(distortion(stepped(there, STEP, FRAME), FRAME)).min() > 1e-3


def test_displacements_are_the_derivative():
    slope = displacements(START, POINTS, FRAME, 8)
    for k in range(8):
        step = np.zeros(8)
        step[k] = 1e-6
        change = (
            moved(stepped(START, step, FRAME), POINTS) - moved(stepped(START, -step, FRAME), POINTS)
        ) / 2e-6
        np.testing.assert_allclose(slope[:, :, k], change, rtol=1e-6, atol=1e-6)


def test_there_and_back():
    there = moved(START, POINTS)
    np.testing.assert_allclose(
        np.column_stack(moved_back(START, there[:, 0], there[:, 1])), POINTS, atol=1e-9
    )


@pytest.mark.parametrize("model", ["translation", "euclidean", "similarity"])
def test_simplified_agrees_at_the_target(model):
    centre = np.array([[FRAME.x, FRAME.y]])
    plain = simplified(START, model, FRAME)
    np.testing.assert_allclose(moved(plain, centre), moved(START, centre))
    np.testing.assert_allclose(
        plain[:2, :2] @ plain[:2, :2].T, np.linalg.det(plain[:2, :2]) * np.eye(2), atol=1e-12
    )


def test_the_spline_goes_through_the_pixels_and_knows_its_slopes():
    rng = np.random.default_rng(0)
    picture = rng.normal(size=(40, 50))
    spline = sampling.coefficients(picture, 0.0)
    y, x = (place.ravel() for place in np.mgrid[3:37, 3:47].astype(float))
    out = np.empty((4, x.size))
    sampling.sample(spline, x, y, out)
    np.testing.assert_allclose(out[0], picture[3:37, 3:47].ravel(), atol=2e-5)
    x, y = rng.uniform(3, 46, 200), rng.uniform(3, 36, 200)
    here, right, left, low, high = (np.empty((4, 200)) for _ in range(5))
    step = 1e-4
    for place, target in (((x, y), here), ((x + step, y), right), ((x - step, y), left)):
        sampling.sample(spline, *place, target)
    for place, target in (((x, y + step), low), ((x, y - step), high)):
        sampling.sample(spline, *place, target)
    np.testing.assert_allclose(here[1], (right[0] - left[0]) / (2 * step), atol=1e-4)
    np.testing.assert_allclose(here[2], (low[0] - high[0]) / (2 * step), atol=1e-4)
    bend = (right[0] + left[0] + low[0] + high[0] - 4 * here[0]) / step**2
    np.testing.assert_allclose(here[3], bend, atol=2e-2)


def test_a_small_negative_blur_sharpens():
    y, x = np.mgrid[:40, :40].astype(float)
    picture = np.exp(-((x - 20) ** 2 + (y - 18) ** 2) / (2 * 9.0)) * 9.0
    blurred = np.exp(-((x - 20) ** 2 + (y - 18) ** 2) / (2 * 9.5)) * 9.0 * 9.0 / 9.5
    values = []
    for variance in (-0.5, 0.0):
        out = np.empty((4, 26 * 26))
        inner = (slice(7, 33), slice(7, 33))
        sampling.sample(sampling.coefficients(blurred, variance), x[inner].ravel(), y[inner].ravel(), out)
        values.append(np.abs(out[0] - picture[inner].ravel()).max())
    assert values[0] < 0.04  # the second order left out: variance² / 8 · 8 · 9 / 3⁴ = 0.03
    assert values[1] > 0.3  # power: without it the peak is too low
