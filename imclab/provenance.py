"""Where a number comes from: versions, digests of files, machine, time."""

from __future__ import annotations

import hashlib
import platform
from functools import lru_cache
from importlib import metadata
from pathlib import Path

import imclab

_LIBRARIES = ("numpy", "scipy", "numba", "opencv-contrib-python-headless", "scikit-image", "h5py")


@lru_cache(maxsize=1)
def versions() -> dict[str, str]:
    """Return the versions of imclab, Python and the libraries that numbers depend on."""
    found = {"imclab": imclab.__version__, "python": platform.python_version()}
    for name in _LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found


def machine() -> str:
    """Return processor architecture and operating system, without the machine's name."""
    return f"{platform.machine()}, {platform.system()} {platform.release()}"


def digest(path: str | Path) -> str:
    """Return the SHA-256 of a file as hexadecimal text."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
