"""The metrics against literal loops, scikit-image, closed forms, and what users get wrong."""

import math
import subprocess
import sys
import warnings
from functools import partial

import numpy as np
import pytest
from skimage.metrics import structural_similarity

from imclab import metrics
from imclab.errors import ImclabError
from tests.oracles_metrics import literal_mse, literal_mssim, literal_ssim, literal_ssim_map

SHAPES = [(11, 11), (12, 17), (40, 23)]


def pair(seed, shape=(40, 23), *, level=255.0):
    rng = np.random.default_rng(seed)
    x = level * rng.random(shape)
    return x, np.clip(0.8 * x + 0.2 * level * rng.random(shape), 0, level)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("level", [1.0, 255.0, 65535.0])
def test_equal_to_literal_double_loops(shape, level):
    x, y = pair(1, shape, level=level)
    assert metrics.mse(x, y) == pytest.approx(literal_mse(x, y), rel=1e-12)
    assert metrics.ssim(x, y, data_range=level) == pytest.approx(literal_ssim(x, y, level), abs=1e-12)
    assert metrics.mssim(x, y, data_range=level) == pytest.approx(literal_mssim(x, y, level), abs=1e-12)
    assert metrics.psnr(x, y, data_range=level) == pytest.approx(
        10 * math.log10(level**2 / literal_mse(x, y)), abs=1e-12
    )
    np.testing.assert_allclose(
        metrics.mssim_map(x, y, data_range=level), literal_ssim_map(x, y, level), atol=1e-12
    )


def test_a_box_window_or_sample_moments_would_be_noticed():
    """Power: definitions that libraries use by default differ by far more than the tolerance."""
    x, y = pair(2)
    ours = metrics.mssim(x, y, data_range=255)
    assert abs(ours - structural_similarity(x, y, data_range=255)) > 1e-4
    gaussian = {"gaussian_weights": True, "sigma": 1.5, "data_range": 255}
    assert abs(ours - structural_similarity(x, y, use_sample_covariance=True, **gaussian)) > 1e-6


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.int16, np.float32, np.float64])
def test_equal_to_scikit_image_under_wangs_settings(kind):
    level = 255 if kind is np.uint8 else 4095
    x, y = (picture.astype(kind) for picture in pair(3, (120, 90), level=level))
    wanted = structural_similarity(
        x.astype(float),
        y.astype(float),
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        data_range=level,
    )
    assert metrics.mssim(x, y, data_range=level) == pytest.approx(wanted, abs=1e-10)


def test_sixteen_bit_pictures_on_a_high_level_keep_their_digits():
    rng = np.random.default_rng(4)
    x = (65000 + rng.integers(0, 30, (30, 30))).astype(np.uint16)
    y = (65000 + rng.integers(0, 30, (30, 30))).astype(np.uint16)
    wanted = literal_mssim(x.astype(float) - 65000, y.astype(float) - 65000, 65535, offset=65000.0)
    assert metrics.mssim(x, y, data_range=65535) == pytest.approx(wanted, abs=1e-12)


def test_unsigned_integers_do_not_wrap():
    dark, bright = np.full((12, 12), 3, np.uint8), np.full((12, 12), 250, np.uint8)
    assert metrics.mse(dark, bright) == 247.0**2
    assert metrics.mse(dark, bright) == metrics.mse(bright, dark)


def test_identical_pictures():
    x, _ = pair(5)
    assert metrics.mse(x, x) == 0
    assert metrics.psnr(x, x, data_range=255) == math.inf
    assert metrics.ssim(x, x, data_range=255) == pytest.approx(1, abs=1e-14)
    assert metrics.mssim(x, x, data_range=255) == pytest.approx(1, abs=1e-14)


def test_constant_pictures_leave_the_luminance_term():
    a, b, c1 = 100.0, 50.0, (0.01 * 255) ** 2
    x, y = np.full((20, 20), a), np.full((20, 20), b)
    wanted = (2 * a * b + c1) / (a * a + b * b + c1)
    for metric in (metrics.ssim, metrics.mssim, metrics.luminance_mssim):
        assert metric(x, y, data_range=255) == pytest.approx(wanted, abs=1e-14)
    zero = np.zeros((20, 20))
    assert metrics.ssim(zero, zero, data_range=255) == 1
    assert metrics.mssim(zero, zero, data_range=255) == 1


def test_luminance_alone_hides_what_the_structure_shows():
    """A weak figure on a level of 40 under noise of 30 dB: the published 0.999 beside 0.5."""
    rng = np.random.default_rng(6)
    clean = np.full((200, 200), 40.0)
    clean[60:140, 80:90] = clean[60:140, 110:120] = 52.0
    noisy = clean + rng.normal(0, 255 / 10**1.5, clean.shape)
    assert metrics.psnr(clean, noisy, data_range=255) == pytest.approx(30, abs=0.1)
    assert metrics.luminance_mssim(clean, noisy, data_range=255) > 0.99
    assert metrics.mssim(clean, noisy, data_range=255) < 0.7


def test_masks_leave_out_what_they_should():
    x, y = pair(7, (50, 40))
    mask = np.zeros(x.shape, bool)
    mask[5:45, 8:35] = True
    broken = np.where(mask, y, np.nan)
    inner = (slice(5, 45), slice(8, 35))
    assert metrics.mse(x, broken, mask=mask) == pytest.approx(metrics.mse(x[inner], y[inner]), rel=1e-14)
    for metric in (metrics.ssim, metrics.mssim, metrics.luminance_mssim, metrics.psnr):
        wanted = metric(x[inner], y[inner], data_range=255)
        assert metric(x, broken, data_range=255, mask=mask) == pytest.approx(wanted, rel=1e-12)
    found = metrics.mssim_map(x, broken, data_range=255, mask=mask)
    assert np.isfinite(found).sum() == 30 * 17


@pytest.mark.parametrize(
    ("x", "y", "wanted"),
    [
        (np.zeros((20, 20)), np.zeros((20, 21)), "one shape"),
        (np.full((20, 20), np.nan), np.zeros((20, 20)), "NaN or infinite"),
        (np.zeros((20, 20)), np.full((20, 20), np.inf), "NaN or infinite"),
        (np.zeros((20, 20), complex), np.zeros((20, 20)), "complex"),
        (np.zeros((20, 20, 3)), np.zeros((20, 20, 3)), "one grey picture"),
        (np.zeros(20), np.zeros(20), "one grey picture"),
        (np.zeros((0, 20)), np.zeros((0, 20)), "one grey picture"),
        (np.array([["a"]]), np.array([["b"]]), "real numbers"),
    ],
)
def test_pictures_that_cannot_be_compared_are_refused(x, y, wanted):
    for metric in (metrics.mse, partial(metrics.psnr, data_range=1), partial(metrics.ssim, data_range=1)):
        with pytest.raises(ImclabError, match=wanted) as caught:
            metric(x, y)
        assert isinstance(caught.value, ValueError)


def test_faults_come_together():
    with pytest.raises(ValueError, match="2 faults") as caught:
        metrics.mse(np.zeros((3, 3), complex), np.zeros(3))
    assert "x: " in str(caught.value) and "y: " in str(caught.value)


@pytest.mark.parametrize("data_range", [0, -1, math.nan, math.inf, "many", None])
def test_bad_ranges_are_refused(data_range):
    x, y = pair(8)
    for metric in (metrics.ssim, metrics.mssim, metrics.psnr, metrics.mssim_map, metrics.luminance_mssim):
        with pytest.raises(ValueError, match="one positive finite number"):
            metric(x, y, data_range=data_range)


def test_the_range_must_be_given():
    x, y = pair(9)
    with pytest.raises(TypeError, match="data_range"):
        metrics.ssim(x, y)


@pytest.mark.parametrize("shape", [(10, 40), (40, 10), (1, 1)])
def test_pictures_smaller_than_the_window_are_refused(shape):
    with pytest.raises(ValueError, match="at least 11 x 11"):
        metrics.mssim(np.zeros(shape), np.zeros(shape), data_range=1)
    assert metrics.ssim(np.zeros(shape), np.zeros(shape), data_range=1) == 1


@pytest.mark.parametrize(
    ("mask", "wanted"),
    [
        (np.zeros((40, 23), bool), "no pixel"),
        (np.ones((40, 23)), "bool"),
        (np.ones((40, 22), bool), "shape"),
        (np.eye(40, 23, dtype=bool), "room for one window"),
    ],
)
def test_masks_that_cannot_be_used_are_refused(mask, wanted):
    x, y = pair(10)
    with pytest.raises(ValueError, match=wanted):
        metrics.mssim(x, y, data_range=255, mask=mask)


@pytest.mark.parametrize(
    ("x", "data_range", "wanted"),
    [
        (np.arange(256, dtype=np.uint8).reshape(16, 16), 65535, "their type ends"),
        (np.linspace(0, 1, 256).reshape(16, 16), 255, "less than 1/128"),
        (np.linspace(0, 255, 256).reshape(16, 16), 1, "exceed"),
        (np.arange(256, dtype=np.uint16).reshape(16, 16) * 16, 255, "exceed"),
        (np.linspace(0, 1, 256).reshape(16, 16), 2, "library's guess"),
    ],
)
def test_a_range_that_does_not_fit_warns(x, data_range, wanted):
    with pytest.warns(metrics.DataRangeWarning, match=wanted) as caught:
        metrics.mssim(x, x, data_range=data_range)
    assert caught[0].filename == __file__
    assert wanted in metrics.range_advice(x, x, data_range=data_range)


def test_a_range_that_fits_does_not_warn():
    rng = np.random.default_rng(11)
    eight, twelve = rng.integers(0, 256, (16, 16)), rng.integers(0, 4096, (16, 16))
    unit = rng.random((16, 16))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        metrics.mssim(eight.astype(np.uint8), eight.astype(np.uint8), data_range=255)
        metrics.mssim(twelve.astype(np.uint16), twelve.astype(np.uint16), data_range=4095)
        metrics.mssim(unit, unit + rng.normal(0, 0.2, unit.shape), data_range=1)


def test_import_is_light():
    code = "import sys, imclab.metrics; print({'numba', 'cv2', 'scipy', 'skimage'} & set(sys.modules))"
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        == "set()\n"
    )
