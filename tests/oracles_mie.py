"""Mie theory written out literally in many digits: eqs. 4-6 with Bessel functions, no recurrence."""

from __future__ import annotations

import mpmath


def coefficients(x: float, m: complex, order: int) -> tuple[mpmath.mpc, mpmath.mpc]:
    """a_n and b_n of eq. 5 for ``m = n - ik``, with 60 digits."""
    with mpmath.workdps(60):
        size, index = mpmath.mpf(x), mpmath.mpc(m)
        inside = index * size

        def psi(z: mpmath.mpc) -> mpmath.mpc:
            return mpmath.sqrt(mpmath.pi * z / 2) * mpmath.besselj(order + mpmath.mpf(1) / 2, z)

        def xi(z: mpmath.mpc) -> mpmath.mpc:
            return mpmath.sqrt(mpmath.pi * z / 2) * mpmath.hankel2(order + mpmath.mpf(1) / 2, z)

        def slope(function, z: mpmath.mpc) -> mpmath.mpc:
            return mpmath.diff(function, z, h=mpmath.mpf(10) ** -25)

        psi_x, psi_in, xi_x = psi(size), psi(inside), xi(size)
        d_psi_x, d_psi_in, d_xi_x = slope(psi, size), slope(psi, inside), slope(xi, size)
        a = (d_psi_in * psi_x - index * psi_in * d_psi_x) / (d_psi_in * xi_x - index * psi_in * d_xi_x)
        b = (index * d_psi_in * psi_x - psi_in * d_psi_x) / (index * d_psi_in * xi_x - psi_in * d_xi_x)
        return a, b
