"""Frames on disk: what a file holds, told from its header, and its pictures one at a time.

TIFF (one or many pages; 8 to 16 bit, or float) and 8 or 16 bit PNG. Nothing here keeps more than
one picture in memory.
"""

from __future__ import annotations

import hashlib
import logging
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
SUFFIXES = (".tif", ".tiff", ".png")


class UnreadableFrameError(Exception):
    """Why a file holds no usable picture; the caller turns it into a fault with its row."""


@dataclass(frozen=True)
class FrameInfo:
    """What the header of a file says: rows, columns, number of pictures, number type."""

    shape: tuple[int, int]
    pictures: int
    dtype: np.dtype[np.generic]


def inspect(path: Path) -> FrameInfo:
    """Read the header of a frame file and check that the file is long enough for its pictures.

    Raises
    ------
    UnreadableFrameError
        With the reason: not a picture, colour, an odd number type, or cut short.
    """
    return _inspect_png(path) if path.suffix.lower() == ".png" else _inspect_tiff(path)


def _inspect_png(path: Path) -> FrameInfo:
    with path.open("rb") as file:
        head = file.read(33)
        file.seek(0, 2)
        size = file.tell()
        file.seek(max(0, size - 12))
        tail = file.read(12)
    if len(head) < 33 or head[:8] != PNG_SIGNATURE or head[12:16] != b"IHDR":
        raise UnreadableFrameError("a file that is not a PNG")
    columns, rows, bits, colour = struct.unpack(">IIBB", head[16:26])
    if colour != 0:
        raise UnreadableFrameError("a colour or palette PNG")
    if bits not in (8, 16):
        raise UnreadableFrameError(f"a {bits}-bit PNG")
    if tail[4:8] != b"IEND":
        raise UnreadableFrameError("a PNG cut short (its end is missing)")
    return FrameInfo((rows, columns), 1, np.dtype(np.uint8 if bits == 8 else np.uint16))


def _inspect_tiff(path: Path) -> FrameInfo:
    import tifffile

    size = path.stat().st_size
    try:
        with _quiet_tifffile(), tifffile.TiffFile(path) as tiff:
            series = tiff.series[0]
            shape, dtype = tuple(series.shape), np.dtype(series.dtype)
            ends = [
                offset + count
                for page in tiff.pages
                if isinstance(page, tifffile.TiffPage)
                for offset, count in zip(page.dataoffsets, page.databytecounts, strict=True)
            ]
            # Three or four grey frames written at once by tifffile come as the planes of one "colour"
            # picture (axes SYX); interleaved samples (YXS) are true colour.
            colour = series.axes.endswith("S")
    except (tifffile.TiffFileError, IndexError, ValueError, struct.error, KeyError) as error:
        raise UnreadableFrameError(f"a file that is not a whole TIFF ({error})") from None
    if ends and max(ends) > size:
        raise UnreadableFrameError(f"a TIFF cut short ({size} of {max(ends)} bytes)")
    shape = tuple(length for length in shape[:-2] if length != 1) + shape[-2:]
    if colour or len(shape) not in (2, 3):
        raise UnreadableFrameError(f"a TIFF of shape {shape}{' in colour' if colour else ''}")
    if dtype.kind not in "uf" or (dtype.kind == "u" and dtype.itemsize > 2):
        raise UnreadableFrameError(f"numbers of type {dtype}")
    return FrameInfo((int(shape[-2]), int(shape[-1])), int(shape[0]) if len(shape) == 3 else 1, dtype)


@contextmanager
def _quiet_tifffile() -> Iterator[None]:
    """Keep tifffile from writing to the log what an error says better here."""
    logger = logging.getLogger("tifffile")
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before


def pictures(path: Path) -> Iterator[NDArray[np.generic]]:
    """Yield the pictures of a frame file one after the other, each (rows, columns).

    Raises
    ------
    UnreadableFrameError
        When a picture cannot be decoded.
    """
    if path.suffix.lower() == ".png":
        yield _read_png(path)
        return
    import tifffile

    try:
        with _quiet_tifffile(), tifffile.TiffFile(path) as tiff:
            series = tiff.series[0]
            if series.dataoffset is not None:
                # Uncompressed and in one piece: mapped, so that a long stack is never in memory whole.
                dtype = np.dtype(series.dtype).newbyteorder(tiff.byteorder)
                whole = np.memmap(path, dtype, "r", series.dataoffset, series.shape)
                for picture in whole.reshape(-1, *series.shape[-2:]):
                    yield np.array(picture, dtype=series.dtype)
            elif len(series.pages) == 1:
                yield from series.asarray().reshape(-1, *series.shape[-2:])
            else:
                for page in series.pages:
                    yield page.asarray()
    except (tifffile.TiffFileError, ValueError, OSError, struct.error, AttributeError) as error:
        raise UnreadableFrameError(f"a TIFF that cannot be decoded ({error})") from None


def _read_png(path: Path) -> NDArray[np.generic]:
    from skimage.io import imread

    try:
        picture = np.asarray(imread(path))
    except (OSError, ValueError, SyntaxError) as error:
        raise UnreadableFrameError(f"a PNG that cannot be decoded ({error})") from None
    if picture.ndim != 2 or picture.dtype not in (np.uint8, np.uint16):
        raise UnreadableFrameError(f"a PNG of type {picture.dtype} and shape {picture.shape}")
    return picture


def digest(path: Path) -> str:
    """Give the SHA-256 of a file, read in pieces."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
