"""Counts to energy and back, flags, samples, noise, on a synthetic camera with a known truth."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import calibration
from calibration import Flag
from tests.unit.calibration.conftest import Calibrated


def test_gain_ratios_are_the_truth_within_one_percent_and_their_errors(calibrated: Calibrated) -> None:
    for gain, true in calibrated.truth.gains.items():
        value, stderr = calibrated.camera.relative_gain(gain)
        assert abs(value / true - 1.0) < 0.01
        assert abs(value - true) <= 4.0 * stderr + 1e-12
    assert calibrated.camera.relative_gain(700) == (1.0, 0.0)
    assert calibrated.camera.reference_gain == 700.0


@pytest.mark.parametrize("gain", [700.0, 760.0])
def test_energy_of_a_noisy_frame_is_the_truth_and_spreads_as_stated(
    calibrated: Calibrated, gain: float
) -> None:
    truth, camera = calibrated.truth, calibrated.camera
    true = float(truth.energy_at(np.array(1800.0), gain))
    stack = np.stack([truth.frame(true, gain, np.random.default_rng(seed)) for seed in range(6)])
    energy, stderr = camera.energy(stack, gain=gain)
    assert energy.shape == stderr.shape == stack.shape and energy.dtype == np.float64
    assert abs(np.nanmean(energy) / true - 1.0) < 0.01
    good = ~camera.bad_pixels & np.isfinite(energy).all(axis=0)
    spread = np.sqrt(np.mean(np.var(energy[:, good], axis=0, ddof=1)))
    assert abs(spread / np.sqrt(np.mean(stderr[:, good] ** 2)) - 1.0) < 0.06
    wrong = replace(camera, log_gain=camera.log_gain + 0.05)  # power: a gain 5 % off is seen
    assert gain == 700.0 or abs(np.nanmean(wrong.energy(stack, gain=gain)[0]) / true - 1.0) > 0.03


def test_counts_and_energy_are_inverse(calibrated: Calibrated) -> None:
    camera = calibrated.camera
    frame = np.full(camera.shape, 1500.0)
    energy, _ = camera.energy(frame, gain=730)
    good = ~camera.bad_pixels
    assert np.allclose(camera.counts(np.nan_to_num(energy), gain=730)[good], 1500.0, rtol=1e-9)
    energies = np.geomspace(1e-17, 1e-16, 5)
    assert np.allclose(camera.energy(camera.counts(energies, gain=790), gain=790)[0], energies, rtol=1e-9)


def test_energy_rises_with_counts_over_the_whole_range(calibrated: Calibrated) -> None:
    raw, energy, error = calibrated.camera.lookup_table(730)
    assert np.all(np.diff(energy) > 0.0) and np.all(np.isfinite(energy))
    assert raw.shape == energy.shape == error.shape and np.all(error < 0.1)


def test_bad_saturated_and_out_of_range_pixels_are_nan_or_flagged(calibrated: Calibrated) -> None:
    camera = calibrated.camera
    frame = np.full(camera.shape, 1500, dtype=np.uint16)
    good = np.argwhere(~camera.bad_pixels)
    saturated, dim = tuple(good[0]), tuple(good[1])
    frame[saturated], frame[dim] = 4095, 62
    energy, stderr = camera.energy(frame, gain=700)
    flags = camera.flags(frame, gain=700)
    assert np.isnan(energy[saturated]) and np.isnan(stderr[saturated]) and flags[saturated] & Flag.SATURATED
    assert np.isfinite(energy[dim]) and flags[dim] == Flag.BELOW_RANGE
    assert np.all(np.isnan(energy[camera.bad_pixels])) and np.all(flags[camera.bad_pixels] & Flag.BAD)
    assert np.count_nonzero(flags) == np.count_nonzero(camera.bad_pixels) + 2


def test_all_bad_pixels_are_found_without_false_alarms(calibrated: Calibrated) -> None:
    maps = calibrated.truth.maps
    true = maps["hot"] | maps["dead"] | maps["blinking"]
    assert np.array_equal(calibrated.camera.bad_pixels, true)
    assert true.sum() == 15  # power: there was something to find


def test_settings_between_are_interpolated_by_the_law_and_others_refused(calibrated: Calibrated) -> None:
    camera = calibrated.camera
    value, stderr = camera.relative_gain(745.0)
    assert abs(value / 2.0**1.5 - 1.0) < 0.01 and stderr > 0.0
    frame = np.full(camera.shape, 1500.0)
    between = camera.energy(frame, gain=745.0)[0]
    expected = np.sqrt(camera.energy(frame, gain=730)[0] * camera.energy(frame, gain=760)[0])
    assert np.nanmax(np.abs(between / expected - 1.0)) < 0.05
    with pytest.raises(calibration.SettingError, match="calibrated settings: 700, 730, 760, 790"):
        camera.relative_gain(800)
    with pytest.raises(LookupError):
        camera.energy(frame, gain=650)


def test_gains_that_follow_no_law_are_not_interpolated(calibrated: Calibrated) -> None:
    crooked = replace(calibrated.camera, log_gain=np.array([0.0, 1.2, 1.3, 2.1]))
    with pytest.raises(calibration.SettingError, match="no law describes"):
        crooked.relative_gain(745.0)


def test_frames_of_another_size_are_refused_with_the_way_out(calibrated: Calibrated) -> None:
    with pytest.raises(calibration.ShapeError, match="typical=True"):
        calibrated.camera.energy(np.zeros((10, 10)), gain=700)
    energy, _ = calibrated.camera.energy(np.full((10, 10), 1500.0), gain=700, typical=True)
    assert np.all(energy == energy[0, 0])


def test_samples_spread_as_the_systematic_uncertainty_says(calibrated: Calibrated) -> None:
    camera = replace(calibrated.camera, setup=replace(calibrated.camera.setup, energy_scale_stderr=0.02))
    draws = camera.sample(300, seed=3)
    raw = float(camera.counts(np.array([4e-17]), gain=760)[0])
    energies = np.array([draw.energy(np.array([raw]), gain=760)[0][0] for draw in draws])
    stated = camera.systematic(4e-17, gain=760)
    assert abs(np.std(np.log(energies)) / stated - 1.0) < 4.0 / np.sqrt(2 * 300) + 0.05
    # The source's scale is common to both energies of a ratio: it cancels.
    other = np.array([draw.energy(np.array([raw]), gain=790)[0][0] for draw in draws])
    second = (float(camera.energy(np.array([raw]), gain=790)[0][0]), 790)
    ratio = camera.ratio_systematic((4e-17, 760), second)
    assert np.std(np.log(energies / other)) < 0.005 < stated
    assert abs(np.std(np.log(energies / other)) / ratio - 1.0) < 4.0 / np.sqrt(2 * 300) + 0.05


def test_drawn_frames_have_the_mean_the_noise_and_the_correlation_of_real_ones(
    calibrated: Calibrated,
) -> None:
    truth, camera = calibrated.truth, calibrated.camera
    gain, good = 760.0, ~calibrated.camera.bad_pixels
    true = float(truth.energy_at(np.array(1500.0), gain))
    rng = np.random.default_rng(4)
    real = np.stack([truth.frame(true, gain, rng) for _ in range(8)]).astype(float)
    drawn = np.stack([camera.draw(np.full(camera.shape, true), gain=gain, rng=rng) for _ in range(8)]).astype(
        float
    )

    def noise(stack: np.ndarray) -> tuple[float, float]:
        jump = np.diff(stack, axis=0)
        neighbours = (jump[:, :, 1:] * jump[:, :, :-1])[:, good[:, 1:] & good[:, :-1]]
        return float(np.sqrt(0.5 * np.var(jump[:, good]))), float(neighbours.mean() / np.var(jump[:, good]))

    assert abs(drawn[:, good].mean() / real[:, good].mean() - 1.0) < 0.01
    assert abs(noise(drawn)[0] / noise(real)[0] - 1.0) < 0.05
    assert abs(noise(drawn)[1] - noise(real)[1]) < 0.05 and noise(real)[1] > 0.3
    assert abs(noise(real)[0] / np.mean(camera.noise(np.full(camera.shape, true), gain=gain)) - 1.0) < 0.05


def test_figures_name_qe_over_f_squared_only(calibrated: Calibrated) -> None:
    names = [figure.name for figure in calibrated.camera.figures]
    assert not any(name.startswith("quantum efficiency") for name in names)
    found = next(figure for figure in calibrated.camera.figures if figure.name.startswith("QE/F²"))
    true = calibrated.truth.efficiency / calibrated.truth.excess
    assert abs(found.value / true - 1.0) < 0.03
    assert all(np.isfinite(figure.value) for figure in calibrated.camera.figures)


def test_a_calibration_travels_to_other_processes(calibrated: Calibrated) -> None:
    copy = pickle.loads(pickle.dumps(calibrated.camera))
    assert copy.relative_gain(760) == calibrated.camera.relative_gain(760)
