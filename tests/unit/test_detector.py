"""The camera as a chain of physical steps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import c, h

from imclab.detector import IntensifiedCamera, ProtectionTrippedError

PHOTON = h * c / 532e-9


def camera(**changes: float) -> IntensifiedCamera:
    settings = {"wavelength": 532e-9, "quantum_efficiency": 0.25, "gain": 3.0, "bit_depth": 16} | changes
    return IntensifiedCamera(**settings)  # type: ignore[arg-type]


def test_mean_counts_follow_photons_efficiency_and_gain() -> None:
    energy = np.full((8, 8), 100 * PHOTON)
    assert camera(dark_counts=7.0).expected_counts(energy) == pytest.approx(100 * 0.25 * 3.0 + 7.0)


@pytest.mark.parametrize("excess", [1.0, 1.6, 2.5])
def test_variance_of_drawn_frames_is_that_of_multiplied_poisson_events(excess: float) -> None:
    """var = F^2 G^2 N + read noise^2; the sample variance has relative error sqrt(2/n)."""
    energy = np.full((200, 200), 4000 * PHOTON)
    box = camera(excess_noise_factor=excess, read_noise_counts=5.0)
    frames = np.stack([box.draw(energy, np.random.default_rng(seed)) for seed in range(4)]).astype(float)
    wanted = excess * 9.0 * 1000 + 25.0 + 1 / 12
    error = np.sqrt(2 / frames.size)
    assert abs(frames.var() / wanted - 1) < 5 * error
    assert abs(frames.var() / (1.02 * wanted) - 1) > 3 * error  # two per cent more would be seen
    assert abs(frames.mean() - 3000) < 5 * np.sqrt(wanted / frames.size)


def test_blur_and_halo_keep_the_light() -> None:
    energy = np.zeros((81, 81))
    energy[40, 40] = 1000 * PHOTON
    box = camera(blur_fwhm_px=2.0, halo_fwhm_px=8.0, halo_share=0.1)
    counts = box.expected_counts(energy)
    assert counts.sum() == pytest.approx(750.0, rel=1e-6)
    assert counts.max() < 0.3 * 750


def test_counts_saturate_and_stay_in_range() -> None:
    box = camera(bit_depth=8, knee_counts=200.0, dark_counts=10.0)
    counts = box.draw(np.full((4, 4), 1e6 * PHOTON), np.random.default_rng(1))
    assert counts.max() <= 255


def test_protection_says_so_instead_of_drawing() -> None:
    box = camera(protection_threshold=1e-15)
    with pytest.raises(ProtectionTrippedError, match="protection"):
        box.draw(np.full((4, 4), 1e-15), np.random.default_rng(1))
