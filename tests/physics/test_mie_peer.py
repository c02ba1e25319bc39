"""Mie theory beside miepython: two programs that share no line of code."""

from __future__ import annotations

import miepython
import numpy as np
import pytest

from imclab.optics import mie


@pytest.mark.parametrize(
    ("x", "m"), [(0.5, 1.33), (3.0, 1.33 - 1e-8j), (23.56, 1.195), (200.0, 1.59 - 0.01j)]
)
def test_agrees_with_miepython(x: float, m: complex) -> None:
    extinction, scattering, backscattering, asymmetry = miepython.efficiencies_mx(m, x)
    found = mie.efficiencies(x, m)
    # miepython ends its sums at terms of 1e-7, so what is not squared has 7 digits.
    assert found.extinction == pytest.approx(extinction, rel=1e-7)
    assert found.scattering == pytest.approx(scattering, rel=1e-9)
    assert found.backscattering == pytest.approx(backscattering, rel=1e-5)
    assert found.asymmetry == pytest.approx(asymmetry, rel=1e-7)
    mu = np.linspace(-1, 1, 37)
    s1, s2 = mie.amplitudes(x, m, mu)
    for own, other in zip((s1, s2), miepython.S1_S2(m, x, mu, norm="wiscombe"), strict=True):
        assert np.max(np.abs(own - other)) <= 1e-6 * np.max(np.abs(own))
    wrong = mie.efficiencies(x * 1.001, m)  # the power partner
    assert wrong.backscattering != pytest.approx(backscattering, rel=1e-5)
