"""The decorator of small kernels that other kernels call; it keeps their types for the checker."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., object])


def scalar_kernel(function: Function) -> Function:
    """Compile a function of scalars, inlined into its caller so that loops around it can vectorise.

    Division by zero gives inf or NaN as in numpy instead of raising, which would be a branch. No
    fast-math: reciprocity and the guards hold to the last digit.
    """
    return cast(Function, numba.njit(error_model="numpy", forceinline=True)(function))
