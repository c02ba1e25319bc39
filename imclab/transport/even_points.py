"""Points spread evenly over the unit cube: Sobol's sequence, shifted at random for every batch.

Walks that take their first random numbers from such points leave fewer gaps than independent ones. All
binary digits of a coordinate are exchanged by one random word (a digital shift), so each point is uniform
and a mean over a batch has no bias; batches have shifts of their own, so their spread is still the error.

Primitive polynomials and first numbers: S. Joe and F. Y. Kuo 2008, "Constructing Sobol sequences with
better two-dimensional projections", SIAM J. Sci. Comput. 30, 2635, table new-joe-kuo-6.21201.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from imclab.transport.kernel_cache import device
from imclab.transport.random import uniform64, words

DIMENSIONS = 12
_BITS = 32

# degree s, coefficients a of the primitive polynomial, first direction numbers m
_JOE_KUO = (
    (1, 0, (1,)),
    (2, 1, (1, 3)),
    (3, 1, (1, 3, 1)),
    (3, 2, (1, 1, 1)),
    (4, 1, (1, 1, 3, 3)),
    (4, 4, (1, 3, 5, 13)),
    (5, 2, (1, 1, 5, 5, 17)),
    (5, 4, (1, 1, 5, 5, 5)),
    (5, 7, (1, 1, 7, 11, 19)),
    (5, 11, (1, 1, 5, 1, 1)),
    (5, 13, (1, 1, 1, 3, 11)),
)


def direction_words() -> NDArray[np.uint32]:
    """Return the words (bits, dimensions) that the Gray code's bits switch."""
    table = np.zeros((_BITS, DIMENSIONS), dtype=np.uint32)
    table[:, 0] = [1 << (_BITS - 1 - bit) for bit in range(_BITS)]
    for dimension, (degree, coefficients, first) in enumerate(_JOE_KUO, start=1):
        numbers = list(first)
        for bit in range(degree, _BITS):
            number = numbers[bit - degree] ^ (numbers[bit - degree] << degree)
            for k in range(1, degree):
                if coefficients >> (degree - 1 - k) & 1:
                    number ^= numbers[bit - k] << k
            numbers.append(number)
        table[:, dimension] = [number << (_BITS - 1 - bit) for bit, number in enumerate(numbers)]
    return table


_DIRECTION_WORDS = direction_words()


@device
def first_point(seed: Any, first: Any, stream: Any) -> Any:
    """Return the point number 0 of a batch that begins with history ``first``: its shift, uint32."""
    point = np.empty(DIMENSIONS, dtype=np.uint32)
    for group in range(DIMENSIONS // 4):
        four = words(seed, first, group, stream)
        point[4 * group], point[4 * group + 1] = four[0], four[1]
        point[4 * group + 2], point[4 * group + 3] = four[2], four[3]
    return point


@device
def advance(point: Any, i: Any) -> None:
    """Turn point number i − 1 into point number i; does nothing for i = 0.

    In the order of the Gray code one bit changes from point to point: the lowest that is set in i.
    """
    if i > 0:
        bit = 0
        while not i >> bit & 1:
            bit += 1
        for dimension in range(DIMENSIONS):
            point[dimension] ^= _DIRECTION_WORDS[bit, dimension]


@device
def coordinate(point: Any, dimension: Any) -> Any:
    """Return one coordinate of a point, strictly between 0 and 1."""
    return uniform64(point[dimension])
