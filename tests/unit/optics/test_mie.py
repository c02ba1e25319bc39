"""The face of the Mie module: shapes, conventions, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from imclab.errors import InputError
from imclab.optics import mie


def test_scalars_give_scalars_and_arrays_broadcast() -> None:
    one = mie.efficiencies(2.0, 1.5)
    assert np.ndim(one.extinction) == 0
    many = mie.efficiencies([[1.0], [2.0]], [1.5, 1.5 - 0.1j, 2.0])
    assert many.extinction.shape == (2, 3)
    assert many.extinction[1, 0] == pytest.approx(one.extinction, rel=1e-14)
    assert mie.efficiencies(2, 1).extinction == 0.0
    assert mie.efficiencies(2, 1).asymmetry == 0.0
    assert mie.efficiencies(np.float32(2), 1.5).extinction == pytest.approx(one.extinction)


def test_amplitudes_broadcast_and_repeat_each_sphere_once() -> None:
    x, m, mu = np.array([[1.0], [3.0], [1.0]]), np.array([[1.5], [1.3 - 0.1j], [1.5]]), np.linspace(-1, 1, 5)
    s1, s2 = mie.amplitudes(x, m, mu)
    assert s1.shape == s2.shape == (3, 5)
    for row in range(3):
        own = mie.amplitudes(x[row, 0], m[row, 0], mu)
        assert np.array_equal(s1[row], own[0])
        assert np.array_equal(s2[row], own[1])
    assert mie.amplitudes(1.0, 1.5, 0.3)[0].shape == ()
    assert mie.amplitudes(1.0, 1.0, 0.3)[0] == 0.0


def test_both_signs_of_absorption_mean_the_same() -> None:
    assert mie.efficiencies(3.0, 1.5 - 0.1j) == mie.efficiencies(3.0, 1.5 + 0.1j)
    found = mie.efficiencies([3.0, 4.0], [1.5 + 0.1j, 1.2])
    assert found.absorption[0] > 0.0
    assert found.absorption[1] == 0.0


def test_amplitudes_at_the_poles_are_equal_up_to_sign() -> None:
    s1, s2 = mie.amplitudes(30.0, 1.33, [1.0, -1.0, np.nextafter(1.0, 0.0), np.nextafter(-1.0, 0.0)])
    assert s1[0] == s2[0]
    assert s1[1] == -s2[1]
    assert s1[2:] == pytest.approx(s1[:2], rel=1e-9)


@pytest.mark.parametrize(
    ("x", "m", "said"),
    [
        (0.0, 1.5, "x: got 0; wanted 1e-08 to 1e+06"),
        (2e6, 1.5, "x: got 2e+06"),
        (float("nan"), 1.5, "x: got nan"),
        ([1.0, -1.0], 1.5, "x: got -1"),
        (1.0, 0.0, "modulus of m"),
        (1.0, -1.5, "real part of m: got -1.5; wanted 0 to 1000"),
        (1.0, complex("nan"), "m: got nan"),
        (1.0, 2e3, "m: got 2000"),
    ],
)
def test_refuses_what_is_outside(x: float, m: complex, said: str) -> None:
    with pytest.raises(InputError, match=said.replace("+", r"\+")):
        mie.efficiencies(x, m)


def test_refuses_cosines_outside_and_a_phase_function_of_nothing() -> None:
    with pytest.raises(InputError, match=r"mu: got 1\.5"):
        mie.amplitudes(1.0, 1.5, [0.0, 1.5])
    with pytest.raises(InputError, match="differs from that of the medium"):
        mie.phase_function(1.0, 1.0, 0.0)
