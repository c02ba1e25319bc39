"""Can the simulation of a range-gated underwater imaging rig be believed? This package finds out.

The names below are loaded when they are first used, so that ``import imclab`` stays light: numba,
OpenCV and matplotlib are imported only by the work that needs them.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from imclab.result import Flux, Result
    from imclab.scene import Scene, load_scene

__all__ = [
    "Flux",
    "Result",
    "Scene",
    "__version__",
    "load_scene",
    "metrics",
    "optics",
    "registration",
    "simulate",
    "transmit",
]

_HOME_OF = {
    "Flux": "imclab.result",
    "Result": "imclab.result",
    "Scene": "imclab.scene",
    "load_scene": "imclab.scene",
    "simulate": "imclab.transport",
    "transmit": "imclab.transport",
}
_MODULES = ("metrics", "optics", "registration")


def __getattr__(name: str) -> Any:
    if name in _HOME_OF:
        return getattr(importlib.import_module(_HOME_OF[name]), name)
    if name in _MODULES:
        return importlib.import_module(f"imclab.{name}")
    raise AttributeError(f"module 'imclab' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
