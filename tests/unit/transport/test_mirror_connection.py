from __future__ import annotations

import numba
import numpy as np
import pytest

from imclab.transport import mirror_connection
from imclab.transport.setup import setup_of
from tests.imaging_scenes import MIRROR, scene


@numba.njit
def _inverse_densities(setup, point, roughness, draws):
    inverse = np.zeros(draws.shape[0])
    for i in range(draws.shape[0]):
        _, density = mirror_connection._place_on_target(
            setup, point, roughness, (draws[i, 0], draws[i, 1], draws[i, 2])
        )
        inverse[i] = 1.0 / density if density > 0.0 else 0.0
    return inverse


@pytest.mark.parametrize("roughness", [0.01, 0.1, 0.5])
def test_places_are_drawn_with_the_density_that_is_stated(roughness: float) -> None:
    """The mean of 1/density over drawn places is the target's area, if and only if the density is theirs."""
    setup = setup_of(scene(1.0, figure=MIRROR, side=0.2))
    draws = np.random.default_rng(3).random((400_000, 3))
    inverse = _inverse_densities(setup, (0.03, -0.02, 0.4), (roughness, 0.02), draws)
    error = inverse.std() / np.sqrt(inverse.size)
    assert error < 0.01 * 0.04
    assert abs(inverse.mean() - 0.04) < 4.0 * error
    assert abs(1.05 * inverse.mean() - 0.04) > 4.0 * error
