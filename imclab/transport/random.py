"""Random numbers by counter, and the elementary functions that turn them into lengths and angles.

Philox4x32 with seven rounds (Salmon, Moraes, Dror, Shaw 2011, "Parallel random numbers: as easy as
1, 2, 3", SC11, table 2: the fewest rounds that pass BigCrush) gives four 32-bit words for a key and
a counter. The key is the seed; the counter is (history, event, stream). A history's numbers depend
on nothing else, so neither the number of threads nor the order of the work can change a result.

The single-precision functions are polynomials without branches, because calls into the C library
would keep LLVM from vectorising the loops they stand in. Their errors, measured over the whole
range by the tests, stay below 4 units in the last place.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic

from imclab.transport.kernel_cache import device

_MULTIPLIER_0 = np.uint64(0xD2511F53)
_MULTIPLIER_1 = np.uint64(0xCD9E8D57)
_WEYL_0 = np.uint64(0x9E3779B9)
_WEYL_1 = np.uint64(0xBB67AE85)
_LOW_WORD = np.uint64(0xFFFFFFFF)
_WORD_BITS = np.uint64(32)
ROUNDS = 7

_LN2 = np.float32(0.6931471805599453)
_HALF_PI = np.float32(1.5707963267948966)
_ONE = np.float32(1.0)
_HALF = np.float32(0.5)
_SQRT2 = np.float32(1.4142135)


@intrinsic  # type: ignore[untyped-decorator]
def _bits_of(typing_context: Any, value: Any) -> Any:
    """Return the bit pattern of a float32 as int32."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.IntType(32))

    return types.int32(types.float32), generate


@intrinsic  # type: ignore[untyped-decorator]
def _float_of(typing_context: Any, value: Any) -> Any:
    """Return the float32 with a given int32 bit pattern."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.FloatType())

    return types.float32(types.int32), generate


@device
def philox(counter: Any, key_0: Any, key_1: Any, rounds: int) -> Any:
    """Return four 32-bit words of a counter of four 32-bit words and a key of two.

    All are uint64. The upper halves gather rubbish that the multiplications ignore; packing words to
    32 bits after each round would cost 1.7 times as much.
    """
    c0, c1, c2, c3 = counter
    for _ in range(rounds):
        product_0 = _MULTIPLIER_0 * (c0 & _LOW_WORD)
        product_1 = _MULTIPLIER_1 * (c2 & _LOW_WORD)
        c0 = (product_1 >> _WORD_BITS) ^ c1 ^ key_0
        c2 = (product_0 >> _WORD_BITS) ^ c3 ^ key_1
        c1 = product_1
        c3 = product_0
        key_0 = key_0 + _WEYL_0
        key_1 = key_1 + _WEYL_1
    return (
        np.uint32(c0 & _LOW_WORD),
        np.uint32(c1 & _LOW_WORD),
        np.uint32(c2 & _LOW_WORD),
        np.uint32(c3 & _LOW_WORD),
    )


@device
def words(seed: Any, history: Any, event: Any, stream: Any) -> Any:
    """Return the four random words of one event of one history.

    Parameters
    ----------
    seed, history : uint64
    event : int
        Number of the event within the history: a launch, a collision, a reflection.
    stream : int
        Tells apart walks that share history numbers, such as those from laser and camera.
    """
    counter = (history & _LOW_WORD, history >> _WORD_BITS, np.uint64(event), np.uint64(stream))
    return philox(counter, seed & _LOW_WORD, seed >> _WORD_BITS, ROUNDS)


@device
def uniform64(word: Any) -> Any:
    """Turn a word into a float64 strictly between 0 and 1, of 32 random bits.

    The paper's range [0, 1] would let ``log(0)`` in; the ends here are 2^-33 and 1 - 2^-33.
    """
    return (np.float64(word) + 0.5) * 2.0**-32


@device
def uniforms(seed: Any, history: Any, event: Any, stream: Any) -> Any:
    """Return four float64 strictly between 0 and 1; arguments as for :func:`words`."""
    w0, w1, w2, w3 = words(seed, history, event, stream)
    return uniform64(w0), uniform64(w1), uniform64(w2), uniform64(w3)


@device
def uniform32(word: Any) -> Any:
    """Turn a word into a float32 in (0, 1), of 31 random bits where it is small.

    Between 2^-32 and 1 - 2^-24: near 0 the resolution is the word's, near 1 it is that of float32,
    so ``-log`` of it reaches 22 mean free paths.
    """
    # through int32, since conversion of unsigned words is no vector instruction before AVX-512
    value = (np.float32(np.int32(word >> np.uint32(1))) + _HALF) * np.float32(2.0**-31)
    return min(value, np.float32(0.99999994))


@device
def log32(value: Any) -> Any:
    """Return the natural logarithm of a positive normal float32."""
    bits = _bits_of(value)
    exponent = np.float32(np.int32(np.int32(bits >> np.int32(23)) - np.int32(127)))
    mantissa = _float_of(np.int32((bits & np.int32(0x007FFFFF)) | np.int32(0x3F800000)))
    large = mantissa > _SQRT2
    mantissa = mantissa * _HALF if large else mantissa
    exponent += _ONE if large else np.float32(0.0)
    x = mantissa - _ONE
    # log(1 + x) = 2 artanh(s), s = x/(2 + x), |s| <= 0.1716
    s = x / (np.float32(2.0) + x)
    s2 = s * s
    tail = s2 * (
        np.float32(0.6666666667)
        + s2 * (np.float32(0.4) + s2 * (np.float32(0.2857142857) + s2 * np.float32(0.2360)))
    )
    return exponent * _LN2 + (s * np.float32(2.0) + s * tail)


@device
def exp32(value: Any) -> Any:
    """Return the exponential of a float32 of at most 88; below -87 it is 0."""
    bounded = max(value, np.float32(-87.0))
    scaled = bounded * np.float32(1.4426950408889634)
    whole = np.floor(scaled + _HALF)
    # the product whole * ln 2 in two parts keeps the remainder exact
    x = bounded - whole * np.float32(0.693359375) + whole * np.float32(2.12194440e-4)
    series = np.float32(1.9875691500e-4)
    series = series * x + np.float32(1.3981999507e-3)
    series = series * x + np.float32(8.3334519073e-3)
    series = series * x + np.float32(4.1665795894e-2)
    series = series * x + np.float32(1.6666665459e-1)
    series = series * x + np.float32(5.0000001201e-1)
    result = series * x * x + x + _ONE
    power = _float_of(np.int32(np.int32(np.int32(whole) + np.int32(127)) << np.int32(23)))
    return result * power if value >= np.float32(-87.0) else np.float32(0.0)


@device
def _sine_cosine_inside(x: Any) -> Any:
    """Return sine and cosine of a float32 within 45 degrees (Cephes' polynomials)."""
    x2 = x * x
    sine = x + x * x2 * (
        np.float32(-1.6666654611e-1) + x2 * (np.float32(8.3321608736e-3) + x2 * np.float32(-1.9515295891e-4))
    )
    cosine = (
        _ONE
        - _HALF * x2
        + x2
        * x2
        * (np.float32(4.166664568e-2) + x2 * (np.float32(-1.388731625e-3) + x2 * np.float32(2.443315711e-5)))
    )
    return sine, cosine


@device
def azimuth32(word: Any) -> Any:
    """Return sine and cosine of a uniformly random azimuth, float32.

    Two bits of the word choose the quadrant, the other thirty the angle within 45 degrees of its axis.
    """
    inside = np.float32(np.int32(word & np.uint32(0x3FFFFFFF))) * np.float32(2.0**-30) - _HALF
    sine, cosine = _sine_cosine_inside(inside * _HALF_PI)
    swap = (word & np.uint32(0x40000000)) != np.uint32(0)
    turn = (word & np.uint32(0x80000000)) != np.uint32(0)
    first = cosine if swap else sine
    second = -sine if swap else cosine
    return (-first if turn else first), (-second if turn else second)


@device
def sine_cosine32(angle: Any) -> Any:
    """Return sine and cosine of a float32 angle from 0 to pi."""
    quarter = np.floor(angle * np.float32(0.6366197723675814) + _HALF)
    # pi/2 in two parts, so that the remainder keeps its digits
    x = angle - quarter * np.float32(1.5703125) - quarter * np.float32(4.838267948966e-4)
    sine, cosine = _sine_cosine_inside(x)
    upright = quarter == _ONE
    opposite = quarter > np.float32(1.5)
    new_sine = cosine if upright else sine
    new_cosine = -sine if upright else cosine
    return (-new_sine if opposite else new_sine), (-new_cosine if opposite else new_cosine)
