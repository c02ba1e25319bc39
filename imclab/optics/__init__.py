"""Optics of the water, of what floats in it and of the target: coefficients, phase functions, surfaces.

The modules are loaded when they are first used, so that ``import imclab.optics`` stays light.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from imclab.optics import (
        fresnel,
        metals,
        mie,
        particles,
        phase,
        phase_table,
        size_distribution,
        surface,
        water,
    )

__all__ = [
    "fresnel",
    "metals",
    "mie",
    "particles",
    "phase",
    "phase_table",
    "size_distribution",
    "surface",
    "water",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        return importlib.import_module(f"imclab.optics.{name}")
    raise AttributeError(f"module 'imclab.optics' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
