"""The noise read from a residual, and what whitening makes of it."""

import cv2
import numpy as np
import pytest

from imclab.registration.appearance import BACKGROUND, FULL, ridge
from imclab.registration.whitening import grid_of, noise_of

SIZE = 96


def _noisy(seed: int, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Noise of the given share of speckle, its variance rising with a known brightness."""
    rng = np.random.default_rng(seed)
    brightness = np.linspace(0.2, 3.0, SIZE)[None].repeat(SIZE, 0)
    speckle = cv2.GaussianBlur(rng.normal(size=(SIZE, SIZE)), (0, 0), 0.8)
    unit = np.sqrt(share) * speckle / speckle.std() + np.sqrt(1 - share) * rng.normal(size=(SIZE, SIZE))
    return unit * np.sqrt(brightness), brightness


def _coarse_excess(field: np.ndarray) -> float:
    """Variance of 6 x 6 means beside that of white noise: 1 when white."""
    blocks = field.reshape(SIZE // 6, 6, SIZE // 6, 6).mean(axis=(1, 3))
    return float(36 * blocks.var() / field.var())


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_noise_is_made_white_and_even(share):
    residual, brightness = _noisy(1, share)
    y, x = (place.ravel() for place in np.mgrid[:SIZE, :SIZE].astype(float))
    noise = noise_of(residual.ravel(), brightness.ravel(), grid_of(x, y, 1))
    white = noise.whitened(residual.reshape(1, -1))[0].reshape(SIZE, SIZE)
    # The variance of 256 block means is known to 9 %, that of a half of the pixels to 2 %.
    assert _coarse_excess(white[:, :]) == pytest.approx(1.0, abs=0.35)
    assert white[:, : SIZE // 2].var() == pytest.approx(white[:, SIZE // 2 :].var(), rel=0.15)
    # Power: the noise as it came is neither even nor, with speckle, white.
    assert residual[:, : SIZE // 2].var() < 0.6 * residual[:, SIZE // 2 :].var()
    assert share == 0.0 or _coarse_excess(residual) > 2.5
    assert (noise.depth < 0.2) == (share == 0.0)


def test_pixels_left_out_count_nothing():
    residual, brightness = _noisy(2, 0.5)
    y, x = (place.ravel() for place in np.mgrid[:SIZE, :SIZE].astype(float))
    some = (x - 40) ** 2 + (y - 50) ** 2 < 30**2
    noise = noise_of(residual.ravel()[some], brightness.ravel()[some], grid_of(x[some], y[some], 1))
    white = noise.whitened(residual.reshape(1, -1)[:, some])[0]
    assert white.shape == (some.sum(),)
    assert np.isfinite(white).all()
    assert 0.3 < noise.depth < 0.85


def test_amplitudes_cost_by_the_contrast_of_the_figure():
    rng = np.random.default_rng(0)
    linear = rng.normal(size=(FULL, 500))
    amplitudes = np.zeros(FULL)
    amplitudes[BACKGROUND] = 10.0
    cost = ridge(linear, amplitudes, noise=4.0)
    assert (cost[: BACKGROUND + 1] == 0).all()  # background and the figure itself are free
    assert cost[BACKGROUND + 1] == pytest.approx(4.0 / (0.5 * 10.0) ** 2)
    np.testing.assert_allclose(ridge(linear, amplitudes / 2, noise=4.0), 4 * cost)
    amplitudes[:BACKGROUND] = 1e3  # a bright background alone makes nothing cheaper
    np.testing.assert_allclose(ridge(linear, amplitudes, noise=4.0), cost)
