"""Photon transfer: events that spread, a sensor behind the intensifier, a real CCD."""

from pathlib import Path

import numpy as np
import pytest
import tifffile

from calibration.noise import TransferPoints, event_energy, fit_transfer, spreading_kernel
from calibration.tally import LAG_REACH, Region, RunStatistics, Tally

REAL = Path(__file__).parents[2] / "reference" / "msfc_ccd_led"
# Measured on the full taps with numpy (half the variance of the difference of two frames).
REAL_CONVERSION = {"upper_left": 0.3951, "upper_right": 0.3996, "lower_left": 0.3955, "lower_right": 0.3978}


def statistics(stack: np.ndarray) -> RunStatistics:
    tally = Tally(Region(np.ones(stack.shape[1:], bool)))
    for picture in stack:
        tally.add(picture)
    return tally.statistics()


def transfer_of(lit: RunStatistics, dark: RunStatistics) -> tuple[float, float, float]:
    """K, the noise spread and its standard error of one linear pair of runs."""
    found = fit_transfer(
        TransferPoints(
            variance=np.array([lit.variance]),
            variance_stderr=np.array([lit.variance_stderr]),
            lever=np.array([lit.mean - dark.mean]),
            lags=lit.lags[None],
            pixels=np.array([float(lit.pixels)]),
            dark_variance=dark.variance,
            dark_variance_stderr=dark.variance_stderr,
            dark_lags=dark.lags,
        )
    )
    return found.shot, found.spread, found.spread_stderr


@pytest.mark.parametrize("tap", REAL_CONVERSION)
def test_conversion_gain_of_a_real_ccd(tap: str) -> None:
    lit, dark = (statistics(tifffile.imread(REAL / f"{tap}_{kind}.tif")) for kind in ("lit", "dark"))
    conversion, spread, _ = transfer_of(lit, dark)
    error = REAL_CONVERSION[tap] * np.sqrt(2.0 / (160 * 200))
    assert abs(conversion - REAL_CONVERSION[tap]) < 3.5 * error
    assert abs(conversion * 1.05 - REAL_CONVERSION[tap]) > 3.5 * error  # power: 5 % would show
    assert abs(spread - 1.0) < 0.06  # a CCD hardly spreads its charge


def test_spread_events_are_counted_right() -> None:
    from scipy import ndimage

    rng = np.random.default_rng(3)
    dark = statistics(np.rint(50.0 + 2.0 * rng.standard_normal((8, 128, 128))))

    def lit(spread: float) -> RunStatistics:
        events = rng.poisson(40.0, (6, 128, 128)).astype(float)
        smooth = [ndimage.gaussian_filter(each, spread, mode="wrap") for each in events] if spread else events
        return statistics(np.rint(50.0 + 10.0 * np.array(smooth) + 2.0 * rng.standard_normal((6, 128, 128))))

    for spread in (0.0, 0.6, 1.0):
        conversion, total, error = transfer_of(lit(spread), dark)
        assert abs(conversion * total / 10.0 - 1.0) < max(0.03, 3.0 * error / total) < 0.1
        assert spread == 0.0 or conversion / 10.0 < 0.35  # power: the naive figure is far off


def test_shot_noise_of_the_sensor_is_told_from_the_events() -> None:
    gain = np.array([1.0, 3.0, 10.0, 30.0])
    value = 2.0 + 1.5 / gain
    found = event_energy(value, 0.01 * value, gain)
    assert abs(found.energy - 2.0) < 3.0 * found.stderr and abs(found.sensor - 1.5) < 0.1
    plain = event_energy(np.full(4, 2.0), np.full(4, 0.02), gain)
    assert plain.energy == pytest.approx(2.0) and plain.sensor == 0.0


def test_one_odd_run_hardly_moves_the_fit() -> None:
    lever = np.linspace(100.0, 3000.0, 12)
    variance = 4.0 + 0.4 * lever
    variance[5] *= 3.0
    lags = np.zeros((12, 2 * LAG_REACH + 1, 2 * LAG_REACH + 1))
    lags[:, LAG_REACH, LAG_REACH] = variance
    found = fit_transfer(
        TransferPoints(
            variance, 0.01 * variance, lever, lags, np.full(12, 1e4), 4.0, 0.02, 4.0 * (lags[0] > 0)
        )
    )
    assert found.outliers == (5,) and abs(found.shot / 0.4 - 1.0) < 0.02


def test_kernel_has_the_correlation_it_was_made_from() -> None:
    at = np.arange(-LAG_REACH, LAG_REACH + 1)
    line = np.exp(-(at**2) / (4.0 * 0.7**2))
    kernel = spreading_kernel(np.outer(line, line))
    assert kernel.sum() == pytest.approx(1.0)
    neighbours = float((kernel[:, 1:] * kernel[:, :-1]).sum() / (kernel**2).sum())
    assert neighbours == pytest.approx(line[LAG_REACH + 1], abs=0.01)


def test_slow_drift_of_the_lamp_is_not_noise() -> None:
    rng = np.random.default_rng(8)
    level = np.linspace(900.0, 1100.0, 40)[:, None, None]
    stack = level + 5.0 * rng.standard_normal((40, 64, 64))
    found = statistics(stack)
    assert abs(found.variance / 25.0 - 1.0) < 0.04
    assert abs(np.var(stack, axis=0).mean() / 25.0 - 1.0) > 50.0  # power: the plain variance drowns in it
