"""Slow, literal versions of the transport engine: one history after another, in double precision."""

# ruff: noqa: NPY002  (inside numba the legacy functions are the generator)

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=False)
def forward_histories(water, beam, distance, count, seed, sums):
    """Follow packets one way, as a textbook does; the yardstick of the forward engine's speed.

    ``water`` is (attenuation, albedo, asymmetry), ``beam`` (spot sigma, divergence sigma). Weights are
    multiplied by the albedo at each collision; ``sums`` gathers transmitted weight, weight r^2, weight
    excess path, its square, reflected weight, its path, absorbed weight, collisions.
    """
    np.random.seed(seed)
    attenuation, albedo, g = water
    spot, divergence = beam
    for _ in range(count):
        radius = spot * math.sqrt(-2.0 * math.log(1.0 - np.random.random()))
        place = 2.0 * math.pi * np.random.random()
        polar = divergence * math.sqrt(-2.0 * math.log(1.0 - np.random.random()))
        azimuth = 2.0 * math.pi * np.random.random()
        x, y, z = radius * math.cos(place), radius * math.sin(place), 0.0
        ux, uy = math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth)
        uz = math.cos(polar)
        weight, path = 1.0, 0.0
        while True:
            step = -math.log(1.0 - np.random.random()) / attenuation
            new_z = z + step * uz
            if new_z >= distance:
                step = (distance - z) / uz
                x, y, path = x + step * ux, y + step * uy, path + step
                sums[0] += weight
                sums[1] += weight * (x * x + y * y)
                sums[2] += weight * (path - distance)
                sums[3] += weight * (path - distance) ** 2
                break
            if new_z <= 0.0:
                path -= z / uz
                sums[4] += weight
                sums[5] += weight * path
                break
            x, y, z, path = x + step * ux, y + step * uy, new_z, path + step
            sums[6] += weight * (1.0 - albedo)
            sums[7] += 1.0
            weight *= albedo
            if weight < 1e-3:
                if np.random.random() > 0.1:
                    break
                weight *= 10.0
            u = np.random.random()
            if g == 0.0:
                mu = 2.0 * u - 1.0
            else:
                term = (1.0 - g * g) / (1.0 - g + 2.0 * g * u)
                mu = (1.0 + g * g - term * term) / (2.0 * g)
            sine = math.sqrt(max(0.0, 1.0 - mu * mu))
            turn = 2.0 * math.pi * np.random.random()
            cos_turn, sin_turn = math.cos(turn), math.sin(turn)
            if abs(uz) > 0.99999:
                ux, uy, uz = sine * cos_turn, sine * sin_turn, math.copysign(mu, uz * mu)
            else:
                across = math.sqrt(1.0 - uz * uz)
                ux, uy, uz = (
                    sine * (ux * uz * cos_turn - uy * sin_turn) / across + ux * mu,
                    sine * (uy * uz * cos_turn + ux * sin_turn) / across + uy * mu,
                    -sine * cos_turn * across + uz * mu,
                )


def philox_literal(counter, key, rounds):
    """Philox4x32 with Python's own integers."""
    c0, c1, c2, c3 = counter
    k0, k1 = key
    word = 2**32
    for _ in range(rounds):
        product_0, product_1 = 0xD2511F53 * c0, 0xCD9E8D57 * c2
        c0, c1, c2, c3 = (
            (product_1 // word) ^ c1 ^ k0,
            product_1 % word,
            (product_0 // word) ^ c3 ^ k1,
            product_0 % word,
        )
        k0, k1 = (k0 + 0x9E3779B9) % word, (k1 + 0xBB67AE85) % word
    return c0, c1, c2, c3


def henyey_greenstein_cosine(g, u):
    """The textbook's formula for the cosine that a uniform number stands for."""
    if g == 0.0:
        return 1.0 - 2.0 * u
    term = (1.0 - g * g) / (1.0 - g + 2.0 * g * (1.0 - u))
    return (1.0 + g * g - term * term) / (2.0 * g)


def turn_by_equation_19(direction, deviation, azimuth):
    """The paper's eq. 19, which divides by zero along the axis."""
    ux, uy, uz = direction
    mu = 1.0 - deviation
    sine, across = math.sqrt(1.0 - mu * mu), math.sqrt(1.0 - uz * uz)
    matrix = np.array(
        [
            [ux * uz / across, -uy / across, ux],
            [uy * uz / across, ux / across, uy],
            [-across, 0.0, uz],
        ]
    )
    return matrix @ np.array([sine * math.cos(azimuth), sine * math.sin(azimuth), mu])
