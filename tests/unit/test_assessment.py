"""Pictures of a pair are kept to as many bits as they are worth."""

from __future__ import annotations

import numpy as np
import pytest

from imclab.assessment import PICTURE_BITS, STDERR_BITS, rounded


@pytest.mark.parametrize("bits", [PICTURE_BITS, STDERR_BITS])
def test_rounding_keeps_the_bits_it_says(bits: int) -> None:
    values = 10.0 ** np.random.default_rng(1).uniform(-25, 5, 2000)
    off = np.abs(rounded(values, bits) / values - 1)
    assert off.max() <= 2.0**-bits
    assert off.max() > 2.0 ** -(bits + 2)  # and no more
    np.testing.assert_array_equal(rounded(rounded(values, bits), bits), rounded(values, bits))


def test_rounding_leaves_what_is_no_number() -> None:
    np.testing.assert_array_equal(rounded(np.array([np.nan, 0.0, -3.0]), 12), [np.nan, 0.0, -3.0])
