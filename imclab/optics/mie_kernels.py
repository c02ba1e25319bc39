"""Mie coefficients, efficiencies and amplitudes of one sphere after another: the compiled part.

Everything that these kernels call stands in this file, so numba's cache on disk notices every edit.

Symbols (van de Hulst; time factor exp(+i w t), ``m = n - ik``): x size parameter, ``z = m x``;
``psi_n(x) = x j_n(x)``, ``chi_n(x) = -x y_n(x)`` Riccati-Bessel functions; ``E_n = psi_{n+1} / psi_n``;
``a_n = t_a / (t_a + i u_a)`` with ``t_a = psi_{n+1} + q_a psi_n``, ``u_a = chi_{n+1} + q_a chi_n`` and

    q_a = (n + 1)(1 - m)(1 + m) / (m**2 x) - E_n(z) / m,        q_b = -m E_n(z).

This is eq. 5 of the paper with both derivatives expressed by E_n, which leaves nothing to cancel for
small x, so that no series is needed there. Since ``psi_n chi_{n+1} - psi_{n+1} chi_n = 1`` the
absorbed part of each term is ``Re a_n - |a_n|**2 = Im q_a / |t_a + i u_a|**2``: directly, not as a
difference.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Function = TypeVar("Function", bound=Callable[..., Any])

# Freedoms of the optimiser that keep NaN and inf as they are.
_FAST = {"contract", "reassoc", "nsz"}
_BLOCK = 128  # angles worked on together: their rows stay in the innermost cache


def _kernel(function: Function) -> Function:
    return cast(Function, numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)(function))


@_kernel
def number_of_terms(x: float) -> int:
    """Return the order after which the coefficients are below 1e-16.

    Wiscombe's 4.05 stops at 1e-7; 7.25 follows from his own criterion with 1e-16, and does not miss the
    narrow resonances above his limit.
    """
    return int(x + 7.25 * np.cbrt(x) + 3.0)


@_kernel
def _start_of_recurrence(modulus: float, across: float, terms: int) -> int:
    """Order from which E_n, started with a guess, has converged at ``terms``.

    Beyond n = |z| the guess is forgotten within a few |z|**(1/3) orders, the faster the farther out:
    with the numbers here to exp(-37). Below |z| only an imaginary part forgets, by
    exp(-(n**2 - terms**2) |Im z| / |z|**2), here to exp(-45).
    """
    width = np.cbrt(modulus)
    start = max(modulus + 8.0 * width + 16.0, terms + 4.0 * width + 10.0)
    if across > 1.0:
        start = min(start, np.sqrt(float(terms) ** 2 + 45.0 * modulus * modulus / across) + 16.0)
    return int(start)


@_kernel
def _fill_ratios(z: Any, first: int, terms: int, out: Any) -> None:
    """Put E_n(z) into ``out[n]`` for n = first ... terms, downward: the stable direction for every z.

    Upward, and with a start below |z|, the error grows; Lentz's continued fraction loses digits in
    proportion to |z| (5e-9 at x = 1e4).
    """
    modulus = abs(z)
    n = _start_of_recurrence(modulus, abs(z.imag), terms)
    inverse, one = 1.0 / z, 0.0 * z + 1.0
    ratio = z / (2.0 * n + 3.0)
    # Stretches of psi itself, psi_{n-1} = (2n+1)/z psi_n - psi_{n+1} from psi_n = 1: too short to
    # overflow, and their divisions do not wait for each other (1.5 times faster, complex 2.5 times).
    while n > terms:
        above, here = ratio, one
        stretch = min(n - terms, 8)
        for k in range(stretch):
            above, here = here, (2.0 * (n - k) + 1.0) * inverse * here - above
        ratio = _quotient(above, here)
        n -= stretch
    out[terms] = ratio
    while n >= first + 4:
        psi_1 = (2.0 * n + 1.0) * inverse - ratio
        psi_2 = (2.0 * n - 1.0) * inverse * psi_1 - 1.0
        psi_3 = (2.0 * n - 3.0) * inverse * psi_2 - psi_1
        psi_4 = (2.0 * n - 5.0) * inverse * psi_3 - psi_2
        out[n - 1] = _quotient(one, psi_1)
        out[n - 2] = _quotient(psi_1, psi_2)
        out[n - 3] = _quotient(psi_2, psi_3)
        ratio = _quotient(psi_3, psi_4)
        out[n - 4] = ratio
        n -= 4
    for k in range(n, first, -1):
        ratio = _quotient(one, (2.0 * k + 1.0) * inverse - ratio)
        out[k - 1] = ratio


@_kernel
def _quotient(a: Any, b: Any) -> Any:
    """``a / b`` for real and complex numbers, without branches; a zero ``b`` gives a huge number."""
    b = b + 1e-60
    return a * np.conj(b) * (1.0 / (b.real * b.real + b.imag * b.imag))


@_kernel
def fill_coefficients(x: float, m: Any, a: ComplexArray, b: ComplexArray) -> tuple[float, float]:
    """Put a_n and b_n into ``a[n - 1]``, ``b[n - 1]``; return Q_sca and Q_abs.

    Parameters
    ----------
    x : float
        Size parameter.
    m : float or complex
        Relative index n - ik with k >= 0; a float compiles to real arithmetic.
    a, b : ndarray of complex
        Filled; their length is `number_of_terms`.
    """
    terms = a.size
    turn = int(x)
    inner = np.empty(terms + 1, dtype=np.asarray(m).dtype)
    outer = np.empty(terms + 1)
    _fill_ratios(m * x, 1, terms, inner)
    _fill_ratios(x, turn, terms, outer)

    inverse = 1.0 / x
    contrast = (1.0 - m) * (1.0 + m) / (m * m) * inverse
    inverse_m = 1.0 / m
    psi_before, psi = np.sin(x), 0.0
    chi_before, chi = np.cos(x), np.cos(x) * inverse + np.sin(x)
    psi = psi_before * inverse - chi_before if turn >= 1 else psi_before * outer[0]
    scattered = absorbed = 0.0
    for n in range(1, terms + 1):
        factor = (2.0 * n + 1.0) * inverse
        psi_next = factor * psi - psi_before if n + 1 <= turn else psi * outer[n]
        chi_next = factor * chi - chi_before
        q = (n + 1.0) * contrast - inner[n] * inverse_m
        t, u = psi_next + q * psi, chi_next + q * chi
        real, imaginary = t.real - u.imag, t.imag + u.real
        scale = 1.0 / (real * real + imaginary * imaginary)
        a[n - 1] = complex(
            (t.real * real + t.imag * imaginary) * scale, (t.imag * real - t.real * imaginary) * scale
        )
        share = (t.real * t.real + t.imag * t.imag) * scale
        lost = q.imag * scale
        q = -m * inner[n]
        t, u = psi_next + q * psi, chi_next + q * chi
        real, imaginary = t.real - u.imag, t.imag + u.real
        scale = 1.0 / (real * real + imaginary * imaginary)
        b[n - 1] = complex(
            (t.real * real + t.imag * imaginary) * scale, (t.imag * real - t.real * imaginary) * scale
        )
        weight = 2.0 * n + 1.0
        scattered += weight * (share + (t.real * t.real + t.imag * t.imag) * scale)
        absorbed += weight * (lost + q.imag * scale)
        psi_before, psi = psi, psi_next
        chi_before, chi = chi, chi_next
    norm = 2.0 * inverse * inverse
    return norm * scattered, norm * absorbed


@_kernel
def _sum_coefficients(x: float, a: ComplexArray, b: ComplexArray) -> tuple[float, float]:
    """Return g Q_sca and Q_back = |sum of (2n + 1)(-1)**n (a_n - b_n)|**2 / x**2."""
    forward = real = imaginary = 0.0
    for n in range(1, a.size + 1):
        a1, b1 = a[n - 1], b[n - 1]
        forward += (2.0 * n + 1.0) / (n * (n + 1.0)) * (a1.real * b1.real + a1.imag * b1.imag)
        if n < a.size:
            a2, b2 = a[n], b[n]
            product = a1.real * a2.real + a1.imag * a2.imag + b1.real * b2.real + b1.imag * b2.imag
            forward += n * (n + 2.0) / (n + 1.0) * product
        weight = (2.0 * n + 1.0) * (1.0 - 2.0 * (n & 1))
        real += weight * (a1.real - b1.real)
        imaginary += weight * (a1.imag - b1.imag)
    return 4.0 * forward / (x * x), (real * real + imaginary * imaginary) / (x * x)


@_kernel
def _efficiencies(x: float, m: Any) -> tuple[float, float, float, float, float]:
    terms = number_of_terms(x)
    a, b = np.empty(terms, np.complex128), np.empty(terms, np.complex128)
    scattered, absorbed = fill_coefficients(x, m, a, b)
    forward, backward = _sum_coefficients(x, a, b)
    return scattered + absorbed, scattered, absorbed, backward, forward / scattered


@_kernel
def efficiencies_of_one(x: float, n: float, k: float) -> tuple[float, float, float, float, float]:
    """Return Q_ext, Q_sca, Q_abs, Q_back and g of one sphere of index n - ik; real arithmetic for k = 0.

    Two floats, because a complex argument would cost 2 us on its way from Python.
    """
    if k != 0.0:
        return _efficiencies(x, complex(n, -abs(k)))
    if n == 1.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    return _efficiencies(x, n)


@_kernel
def efficiencies_of_many(x: Array, m: ComplexArray) -> Array:
    """Return Q_ext, Q_sca, Q_abs, Q_back and g of every sphere, shape (5, count)."""
    out = np.empty((5, x.size))
    for i in range(x.size):
        one = efficiencies_of_one(x[i], m[i].real, m[i].imag)
        out[0, i], out[1, i], out[2, i], out[3, i], out[4, i] = one
    return out


@_kernel
def _angular_sums(a: ComplexArray, b: ComplexArray, work: Array) -> None:
    """Add up S1 + S2 and S1 - S2 at the angles of one block, orders outside and angles inside.

    ``work`` holds seven rows of `_BLOCK` numbers one behind the other: mu, pi_{n-1}, pi_n (to begin
    with 0 and 1), then the real and imaginary parts of both sums (to begin with 0). In one array at
    constant distances the rows are seen not to overlap, which lets the inner loop vectorise: 4 times
    faster than with seven arrays. Two orders in one pass halve the traffic.
    """
    for first in range(1, a.size + 1, 2):
        n = float(first)
        second = first < a.size
        weight = (2.0 * n + 1.0) / (n * (n + 1.0))
        weight_2 = (2.0 * n + 3.0) / ((n + 1.0) * (n + 2.0)) if second else 0.0
        a_2 = a[first] if second else 0.0j
        b_2 = b[first] if second else 0.0j
        plus, minus = weight * (a[first - 1] + b[first - 1]), weight * (a[first - 1] - b[first - 1])
        plus_2, minus_2 = weight_2 * (a_2 + b_2), weight_2 * (a_2 - b_2)
        p_r, p_i, m_r, m_i = plus.real, plus.imag, minus.real, minus.imag
        p_r2, p_i2, m_r2, m_i2 = plus_2.real, plus_2.imag, minus_2.real, minus_2.imag
        step, step_2 = (n + 1.0) / n, (n + 2.0) / (n + 1.0)
        for j in range(_BLOCK):
            mu, pi_0, pi_1 = work[j], work[j + _BLOCK], work[j + 2 * _BLOCK]
            s = mu * pi_1
            t = s - pi_0
            tau_1 = n * t - pi_0
            pi_2 = s + step * t
            s = mu * pi_2
            t = s - pi_1
            tau_2 = (n + 1.0) * t - pi_1
            work[j + _BLOCK] = pi_2
            work[j + 2 * _BLOCK] = s + step_2 * t
            sum_1, difference_1 = pi_1 + tau_1, pi_1 - tau_1
            sum_2, difference_2 = pi_2 + tau_2, pi_2 - tau_2
            work[j + 3 * _BLOCK] += p_r * sum_1 + p_r2 * sum_2
            work[j + 4 * _BLOCK] += p_i * sum_1 + p_i2 * sum_2
            work[j + 5 * _BLOCK] += m_r * difference_1 + m_r2 * difference_2
            work[j + 6 * _BLOCK] += m_i * difference_1 + m_i2 * difference_2


@_kernel
def amplitudes_from(a: ComplexArray, b: ComplexArray, mu: Array) -> tuple[ComplexArray, ComplexArray]:
    """Return S1 and S2 at the cosines ``mu`` from the coefficients."""
    s1, s2 = np.empty(mu.size, np.complex128), np.empty(mu.size, np.complex128)
    work = np.empty(7 * _BLOCK)
    for start in range(0, mu.size, _BLOCK):
        count = min(_BLOCK, mu.size - start)
        work[:] = 0.0
        work[:count] = mu[start : start + count]
        work[2 * _BLOCK : 3 * _BLOCK] = 1.0
        _angular_sums(a, b, work)
        for j in range(count):
            plus = complex(work[j + 3 * _BLOCK], work[j + 4 * _BLOCK])
            minus = complex(work[j + 5 * _BLOCK], work[j + 6 * _BLOCK])
            s1[start + j] = 0.5 * (plus + minus)
            s2[start + j] = 0.5 * (plus - minus)
            if abs(work[j]) == 1.0:  # there the recurrence of pi_n only loses digits
                s1[start + j], s2[start + j] = _amplitudes_on_axis(a, b, work[j])
    return s1, s2


@_kernel
def _amplitudes_on_axis(a: ComplexArray, b: ComplexArray, mu: float) -> tuple[complex, complex]:
    """Return S1 and S2 at 0 (mu = 1) or 180 degrees (mu = -1), where S2 = mu S1."""
    real = imaginary = 0.0
    sign = 1.0
    for n in range(1, a.size + 1):
        weight = 0.5 * (2.0 * n + 1.0) * sign
        real += weight * (a[n - 1].real + mu * b[n - 1].real)
        imaginary += weight * (a[n - 1].imag + mu * b[n - 1].imag)
        sign *= mu
    return complex(real, imaginary), complex(mu * real, mu * imaginary)


@_kernel
def amplitudes_of_one(x: float, n: float, k: float, mu: Array) -> tuple[ComplexArray, ComplexArray]:
    """Return S1 and S2 at the cosines ``mu`` of one sphere of index n - ik."""
    terms = 0 if n == 1.0 and k == 0.0 else number_of_terms(x)
    a, b = np.empty(terms, np.complex128), np.empty(terms, np.complex128)
    if terms > 0 and k == 0.0:
        fill_coefficients(x, n, a, b)
    elif terms > 0:
        fill_coefficients(x, complex(n, -abs(k)), a, b)
    return amplitudes_from(a, b, mu)


@_kernel
def mean_intensity_of_many(x: Array, m: complex, weights: Array, mu: Array) -> Array:
    """Return the weighted sum over spheres of ``|S1|**2 + |S2|**2`` at the cosines ``mu``."""
    total = np.zeros(mu.size)
    for i in range(x.size):
        s1, s2 = amplitudes_of_one(x[i], m.real, m.imag, mu)
        for j in range(mu.size):
            one, two = s1[j], s2[j]
            square = one.real * one.real + one.imag * one.imag + two.real * two.real + two.imag * two.imag
            total[j] += weights[i] * square
    return total


@_kernel
def chebyshev_sum(coefficients: Array, mu: Array) -> Array:
    """Return the Chebyshev series at the points ``mu`` by Clenshaw's recurrence, block by block."""
    out = np.empty(mu.size)
    work = np.empty(3 * _BLOCK)  # mu, and the two latest terms of the recurrence
    for start in range(0, mu.size, _BLOCK):
        count = min(_BLOCK, mu.size - start)
        work[:] = 0.0
        work[:count] = mu[start : start + count]
        for order in range(coefficients.size - 1, 0, -1):
            coefficient = coefficients[order]
            for j in range(_BLOCK):
                latest = work[j + _BLOCK]
                work[j + _BLOCK] = coefficient + 2.0 * work[j] * latest - work[j + 2 * _BLOCK]
                work[j + 2 * _BLOCK] = latest
        for j in range(count):
            out[start + j] = coefficients[0] + work[j] * work[j + _BLOCK] - work[j + 2 * _BLOCK]
    return out
