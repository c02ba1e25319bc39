from __future__ import annotations

import math

import numba
import numpy as np
import pytest
from scipy import stats

from imclab.transport import random
from tests import judging, oracles_transport

# Random123's published answers (kat_vectors): counter, key, rounds, words
KNOWN = [
    ((0, 0, 0, 0), (0, 0), 7, (0x5F6FB709, 0x0D893F64, 0x4F121F81, 0x4F730A48)),
    ((2**32 - 1,) * 4, (2**32 - 1,) * 2, 7, (0x5207DDC2, 0x45165E59, 0x4D8EE751, 0x8C52F662)),
    ((0, 0, 0, 0), (0, 0), 10, (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        10,
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]


@numba.njit
def _philox(counter, key_0, key_1, rounds):
    return random.philox(counter, key_0, key_1, rounds)


@numba.njit
def _uniforms(seed, first, count, event, stream):
    table = np.empty((count, 4))
    for i in range(count):
        table[i] = random.uniforms(seed, first + np.uint64(i), event, stream)
    return table


@numba.njit
def _single(values, words):
    logarithms, exponentials = np.empty_like(values), np.empty_like(values)
    circle, angles = np.empty((words.size, 2), np.float32), np.empty((words.size, 2), np.float32)
    uniform = np.empty(words.size, np.float32)
    for i in range(values.size):
        logarithms[i] = random.log32(values[i])
        exponentials[i] = random.exp32(-values[i] * np.float32(90.0))
        circle[i] = random.azimuth32(words[i])
        angles[i] = random.sine_cosine32(values[i] * np.float32(math.pi))
        uniform[i] = random.uniform32(words[i])
    return logarithms, exponentials, circle, angles, uniform


def _words(*values):
    return tuple(np.uint64(value) for value in values)


@pytest.mark.parametrize(("counter", "key", "rounds", "words"), KNOWN)
def test_philox_gives_the_published_words(counter, key, rounds, words) -> None:
    assert tuple(map(int, _philox(_words(*counter), *_words(*key), rounds))) == words
    assert oracles_transport.philox_literal(counter, key, rounds) == words


def test_philox_agrees_with_plain_integers() -> None:
    draws = np.random.default_rng(1).integers(0, 2**32, (200, 6))
    for *counter, key_0, key_1 in draws.tolist():
        literal = oracles_transport.philox_literal(tuple(counter), (key_0, key_1), 7)
        assert tuple(map(int, _philox(_words(*counter), *_words(key_0, key_1), 7))) == literal


def test_uniforms_are_uniform_and_their_streams_independent() -> None:
    table = _uniforms(np.uint64(1), np.uint64(0), 200_000, 3, 2)
    other = _uniforms(np.uint64(1), np.uint64(0), 200_000, 3, 1)
    later = _uniforms(np.uint64(1), np.uint64(0), 200_000, 4, 2)
    for column in table.T:
        counts = np.histogram(column, 1000, (0.0, 1.0))[0]
        assert not judging.reject_chi2(counts, np.full(1000, column.size / 1000))
    pairs = [(table[:, k], other[:, k]) for k in range(4)] + [(table[:, k], later[:, k]) for k in range(4)]
    pairs.append((table[:-1, 0], table[1:, 0]))
    z = [math.sqrt(len(table)) * np.corrcoef(a, b)[0, 1] for a, b in pairs]
    assert not judging.reject(z)
    tilted = np.histogram(table[:, 0] ** 1.05, 1000, (0.0, 1.0))[0]
    assert judging.reject_chi2(tilted, np.full(1000, len(table) / 1000))


def test_histories_are_numbered_beyond_32_bits() -> None:
    low = _uniforms(np.uint64(1), np.uint64(5), 1, 0, 0)
    high = _uniforms(np.uint64(1), np.uint64(2**32 + 5), 1, 0, 0)
    seeds = _uniforms(np.uint64(2**32 + 1), np.uint64(5), 1, 0, 0)
    assert (low != high).all()
    assert (low != seeds).all()


def test_the_ends_of_the_uniform_range_stay_inside() -> None:
    words = np.array([0, 1, 2**31, 2**32 - 2, 2**32 - 1], np.uint32)
    *_, uniform = _single(np.full(words.size, np.float32(0.5)), words)
    assert uniform.min() > 0.0
    assert uniform.max() < 1.0
    assert uniform.min() == pytest.approx(2.0**-32)
    assert np.isfinite(np.log(uniform)).all()


def test_single_precision_functions_keep_their_promise() -> None:
    rng = np.random.default_rng(2)
    values = np.concatenate([10.0 ** rng.uniform(-9, 0, 200_000), rng.uniform(0, 1, 200_000)])
    values = values.astype(np.float32)
    words = rng.integers(0, 2**32, values.size, dtype=np.uint32)
    logarithms, exponentials, circle, angles, uniform = _single(values, words)
    exact = np.log(values.astype(float))
    assert np.max(np.abs(logarithms - exact) / np.spacing(np.abs(exact).astype(np.float32))) < 4.0
    argument = -(values * np.float32(90.0)).astype(float)
    kept = argument >= -87.0
    assert np.max(np.abs(exponentials[kept] / np.exp(argument[kept]) - 1.0)) < 4 * 2.0**-24
    assert (exponentials[~kept] == 0.0).all()
    angle = (values * np.float32(math.pi)).astype(float)
    assert np.abs(angles - np.stack([np.sin(angle), np.cos(angle)], axis=1)).max() < 4 * 2.0**-24
    assert np.abs(np.hypot(*circle.astype(float).T) - 1.0).max() < 4 * 2.0**-24
    azimuth = np.arctan2(circle[:, 0], circle[:, 1]) % (2 * np.pi)
    assert stats.kstest(azimuth[::4] / (2 * np.pi), "uniform").pvalue > 1e-3
    assert stats.kstest(uniform[::4], "uniform").pvalue > 1e-3
    assert stats.kstest(uniform[::4] ** 1.02, "uniform").pvalue < 1e-3
