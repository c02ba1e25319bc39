"""Intervals of metrics: coverage on data of known law, and what is refused."""

from functools import partial

import numpy as np
import pytest
from scipy.stats import bootstrap

from imclab import metrics
from imclab.errors import ImclabError

CLEAN = 255 * np.random.default_rng(1).random((12, 12))
PSNR = partial(metrics.psnr, data_range=255)


def draw(rng):
    return CLEAN + rng.normal(0, 20, CLEAN.shape)


def truth_of_psnr():
    rng = np.random.default_rng(2)
    return float(np.mean([PSNR(CLEAN, draw(rng)) for _ in range(3000)]))


def test_intervals_hold_the_truth():
    """60 experiments at 95 %: binomial mean 57; 49 or fewer would be 4 standard deviations low."""
    truth, rng = truth_of_psnr(), np.random.default_rng(3)
    from_frames = from_noise = too_narrow = 0
    for seed in range(60):
        frames = [draw(rng) for _ in range(20)]
        found = metrics.confidence_from_frames(PSNR, CLEAN, frames, resamples=499, seed=seed)
        from_frames += found.low <= truth <= found.high
        middle, half = found.value, (found.high - found.low) / 2
        too_narrow += abs(truth - middle) <= half / 3  # power: an interval three times too narrow
        one = metrics.confidence_from_noise(PSNR, CLEAN, draw(rng), draw=draw, draws=60, seed=seed)
        from_noise += one.low <= truth <= one.high
    assert from_frames > 49
    assert from_noise > 49
    assert too_narrow < 49


def test_the_same_seed_gives_the_same_interval():
    rng = np.random.default_rng(4)
    frames = [draw(rng) for _ in range(12)]
    first, second = (metrics.confidence_from_frames(PSNR, CLEAN, frames, seed=5) for _ in range(2))
    assert first == second
    assert first.low < first.value < first.high
    assert first.frames == 12


def test_equal_frames_give_a_point():
    found = metrics.confidence_from_frames(PSNR, CLEAN, [CLEAN + 1] * 10)
    assert found.low == found.value == found.high


@pytest.mark.parametrize(
    ("call", "wanted"),
    [
        (lambda: metrics.confidence_from_frames(PSNR, CLEAN, [CLEAN + 1] * 9), "at least 10"),
        (lambda: metrics.confidence_from_frames(PSNR, CLEAN, [CLEAN] * 10), "NaN or infinite"),
        (lambda: metrics.confidence_from_frames(PSNR, CLEAN, [CLEAN + 1] * 10, level=95), "between 0 and 1"),
        (lambda: metrics.confidence_from_noise(PSNR, CLEAN, CLEAN, draw=draw, draws=2), "at least 10"),
    ],
)
def test_what_cannot_be_an_interval_is_refused(call, wanted):
    with pytest.raises(ImclabError, match=wanted):
        call()


def test_ten_frames_are_enough_for_an_honest_interval():
    """400 means of ten normal numbers: 90 to 99 % within; plain BCa holds 87 % (power)."""
    rng = np.random.default_rng(4)
    widened = plain = 0
    for seed in range(400):
        values = rng.standard_normal(10)
        found = metrics.confidence_from_frames(
            lambda _, frame: float(frame), 0.0, values, resamples=999, seed=seed
        )
        widened += found.low <= 0 <= found.high
        narrow = bootstrap((values,), np.mean, n_resamples=499, method="BCa", rng=seed).confidence_interval
        plain += narrow.low <= 0 <= narrow.high
    assert 360 <= widened <= 396
    assert plain < 360
