"""Kernels compiled once and kept on disk, never served after an edit of the sources.

numba's cache on disk notices an edit of the file a kernel stands in, but not of a helper in another
file: it would go on serving the old machine code. Here the name under which a kernel is kept carries
a digest of every Python file of the package, so an edit anywhere gives the kernel a new name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba

PACKAGE = Path(__file__).resolve().parents[1]

FAST_ARITHMETIC = frozenset({"contract", "arcp", "nsz", "afn", "reassoc"})
"""Freedoms given to the optimiser. ``nnan`` and ``ninf`` stay out: they would remove the guards."""


@cache
def source_digest() -> str:
    """Sixteen hexadecimal digits that change with any Python file of the package."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(path.relative_to(PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cached_kernel(function: Callable[..., Any]) -> Any:
    """Compile an entry kernel: releases the GIL, kept on disk under the digest of the sources.

    Only the outermost function, the one that Python calls, needs this; what it calls is plain
    :func:`device` code and compiled into it.
    """
    return _compile(function, allocates=True)


def cached_kernel_without_allocation(function: Callable[..., Any]) -> Any:
    """Do what `cached_kernel` does for a kernel that makes no arrays but only fills those it is given.

    numba then counts no references. The counting is atomic, happens whenever an array is taken out of
    a NamedTuple, and made the forward engine 8 times slower.
    """
    return _compile(function, allocates=False)


def _compile(function: Callable[..., Any], *, allocates: bool) -> Any:
    function.__qualname__ = f"{function.__qualname__}_{source_digest()}"
    return numba.njit(
        cache=True, nogil=True, error_model="numpy", fastmath=set(FAST_ARITHMETIC), _nrt=allocates
    )(function)


def device(function: Callable[..., Any]) -> Any:
    """Compile a function that kernels call, always inlined so that loops around it can vectorise."""
    return numba.njit(error_model="numpy", fastmath=set(FAST_ARITHMETIC), forceinline=True)(function)
