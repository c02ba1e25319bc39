from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ndtr

from imclab import sharpness


def analytic_edge(
    *, sigma: float, degrees: float, shape: tuple[int, int] = (32, 17), offset: float = 0.3
) -> np.ndarray:
    """Means over square pixels of an edge with a Gaussian blur: an erf along its normal."""
    fine = 8
    step = (np.arange(fine) + 0.5) / fine - 0.5
    rows = (np.arange(shape[0])[:, None] + step).ravel() - (shape[0] - 1) / 2
    columns = (np.arange(shape[1])[:, None] + step).ravel() - (shape[1] - 1) / 2 - offset
    y, x = np.meshgrid(rows, columns, indexing="ij")
    away = x * math.cos(math.radians(degrees)) - y * math.sin(math.radians(degrees))
    return 1.0 + 9.0 * ndtr(away / sigma).reshape(shape[0], fine, shape[1], fine).mean(axis=(1, 3))


def analytic_mtf(frequency: np.ndarray, *, sigma: float, degrees: float) -> np.ndarray:
    """Gaussian blur times the square pixel, seen along the edge's normal."""
    angle = math.radians(degrees)
    pixel = np.sinc(frequency * math.cos(angle)) * np.sinc(frequency * math.sin(angle))
    return np.exp(-2 * (np.pi * frequency * sigma) ** 2) * pixel


@pytest.mark.parametrize("sigma", [0.5, 0.8, 1.2])
@pytest.mark.parametrize("degrees", [1.5, 3.0, 6.0, 10.0])
def test_response_of_an_analytic_edge(sigma: float, degrees: float) -> None:
    found = sharpness.slanted_edge(analytic_edge(sigma=sigma, degrees=degrees))
    assert found is not None
    below = found.frequency <= 0.5
    frequency = found.frequency[below]
    tolerance = 0.015
    error = np.abs(found.mtf[below] - analytic_mtf(frequency, sigma=sigma, degrees=degrees))
    wrong = np.abs(found.mtf[below] - analytic_mtf(frequency, sigma=1.1 * sigma, degrees=degrees))
    assert error.max() < tolerance
    assert wrong.max() > tolerance  # a blur wrong by a tenth is told apart
    assert math.degrees(found.angle) == pytest.approx(degrees, abs=0.1)


@pytest.mark.parametrize("turn", [lambda p: p.T, lambda p: p[:, ::-1], lambda p: p[::-1], lambda p: p])
def test_response_does_not_depend_on_the_side_of_the_light(turn: object) -> None:
    patch = analytic_edge(sigma=0.8, degrees=4.0)
    found = sharpness.slanted_edge(turn(patch))  # type: ignore[operator]
    straight = sharpness.slanted_edge(patch)
    assert found is not None
    assert straight is not None
    assert found.mtf50.value == pytest.approx(straight.mtf50.value, rel=5e-3)


def test_standard_error_of_half_modulation_covers_the_truth() -> None:
    clean = analytic_edge(sigma=0.8, degrees=4.0)
    truth = sharpness.slanted_edge(clean)
    assert truth is not None
    stderr = np.full(clean.shape, 0.15)
    scores = []
    for seed in range(40):
        noisy = clean + stderr * np.random.default_rng(seed).standard_normal(clean.shape)
        found = sharpness.slanted_edge(noisy, stderr, seed=seed)
        assert found is not None
        scores.append((found.mtf50.value - truth.mtf50.value) / found.mtf50.stderr)
    spread = float(np.std(scores))
    # The standard deviation of 40 scores scatters by 11 %; its own estimate from 40 draws by another 11 %.
    assert 0.55 < spread < 1.6
    assert not 0.55 < 3 * spread < 1.6  # errors three times too small would be noticed


def test_nothing_is_made_of_a_patch_without_an_edge() -> None:
    assert sharpness.slanted_edge(np.ones((32, 17))) is None
    bump = np.exp(-((np.arange(17) - 1.0) ** 2)) * np.ones((32, 1))
    assert sharpness.slanted_edge(bump) is None


def test_edge_is_found_on_one_side_of_a_bar_and_nowhere_in_a_disc() -> None:
    y, x = np.mgrid[:96, :96] - 47.5
    turned = x * math.cos(0.06) + y * math.sin(0.06)
    bar = ndtr((14.0 - np.abs(turned)) / 0.8) * ndtr((36.0 - np.abs(y)) / 0.8)
    region = np.ones(bar.shape, dtype=bool)
    window = sharpness.find_edge(bar, region)
    assert window is not None
    found = sharpness.slanted_edge(bar[window])
    assert found is not None
    assert found.angle == pytest.approx(0.06, abs=0.005)
    small_disc = ndtr((7.0 - np.hypot(x, y)) / 0.8)
    assert sharpness.find_edge(small_disc, region) is None
    assert sharpness.find_edge(bar[:10, :10], region[:10, :10]) is None


def test_window_of_the_edge_lies_inside_the_region() -> None:
    y, x = np.mgrid[:96, :96] - 47.5
    edge = ndtr((x + 0.05 * y) / 0.8)
    region = np.zeros(edge.shape, dtype=bool)
    region[50:90] = True
    window = sharpness.find_edge(edge, region)
    assert window is not None
    assert region[window].all()


def test_profile_averages_the_band_and_leaves_out_what_does_not_count() -> None:
    picture = np.arange(12.0).reshape(4, 3)
    stderr = np.full((4, 3), 0.2)
    region = np.ones((4, 3), dtype=bool)
    region[1, 0] = False
    region[:, 2] = False
    found = sharpness.profile(picture, stderr, region, axis=0, band=slice(1, 3))
    assert found.mean[:2] == pytest.approx([6.0, 5.5])
    assert found.stderr[:2] == pytest.approx([0.2, 0.2 / math.sqrt(2)])
    assert np.isnan(found.mean[2])
    down = sharpness.profile(picture, stderr, region, axis=1, band=slice(0, 1))
    assert down.mean[[0, 2]] == pytest.approx([0.0, 6.0])


def test_contrast_and_its_error_by_draws() -> None:
    bright = np.zeros((20, 20), dtype=bool)
    bright[:, 10:] = True
    clean = np.where(bright, 9.0, 1.0)
    stderr = np.full(clean.shape, 0.5)
    found = sharpness.contrast(clean, stderr, bright=bright, dark=~bright)
    assert found.value == pytest.approx(0.8)
    rng = np.random.default_rng(0)
    draws = [
        sharpness.contrast(
            clean + stderr * rng.standard_normal(clean.shape), stderr, bright=bright, dark=~bright
        )
        for _ in range(400)
    ]
    assert np.std([draw.value for draw in draws]) == pytest.approx(found.stderr, rel=4 / math.sqrt(800))
