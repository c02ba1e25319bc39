"""Pictures of the comparison as small PNG files: one colour table each, no resampling but block means."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imclab.comparison import Pair

FloatArray = NDArray[np.float64]

LARGEST = 320
"""Pictures with more pixels along a side are shown as means of blocks."""

LEVELS = 96
"""Colours of a scale: finer steps cannot be told apart, and noise would fill the file with them."""

DIFFERENCE_SHARE, Z_LIMIT = 0.3, 5.0
"""Ends of the scales of difference (share of the brightest level) and Z."""


@dataclass(frozen=True)
class Scale:
    """A colour scale with fixed ends, and the colour of bad, saturated or unseen pixels."""

    colours: str
    low: float
    high: float
    missing: tuple[int, int, int] = (128, 128, 132)


ENERGY = Scale("gray", 0.0, 1.0, missing=(74, 98, 130))
DIFFERENCE = Scale("RdBu_r", -DIFFERENCE_SHARE, DIFFERENCE_SHARE)
Z_SCORE = Scale("PuOr_r", -Z_LIMIT, Z_LIMIT)
SIMILARITY = Scale("cividis", 0.0, 1.0)


def picture_set(pair: Pair, similarity: FloatArray, *, comment: str) -> dict[str, bytes]:
    """Return the PNG files of one pair: measured, simulated, difference, z, similarity.

    Parameters
    ----------
    pair : Pair
    similarity : array (rows, columns)
        SSIM map.
    comment : str
        Written into each file, for instance that the data are synthetic.
    """
    top = brightest(pair)
    window = _window(pair)
    difference = np.where(pair.region, (pair.simulated - pair.measured) / top, np.nan)
    shown = {
        "measured": (pair.measured / top, ENERGY),
        "simulated": (pair.simulated / top, ENERGY),
        "difference": (difference, DIFFERENCE),
        "z": (pair.z_map, Z_SCORE),
        "similarity": (similarity, SIMILARITY),
    }
    return {
        name: coloured(_blocks(picture[window]), scale, comment=f"{pair.name}: {name}. {comment}".strip())
        for name, (picture, scale) in shown.items()
    }


def brightest(pair: Pair) -> float:
    """Energy per pixel that is shown white: the 99.9 % quantile of both pictures, J."""
    both = np.concatenate([pair.measured[pair.region], pair.simulated[pair.region]])
    return float(max(np.quantile(both, 0.999), np.finfo(float).tiny))


def coloured(picture: FloatArray, scale: Scale, *, comment: str = "") -> bytes:
    """Return ``picture`` as PNG with a colour table; the same bytes from the same picture."""
    from PIL import Image, PngImagePlugin

    share = (picture - scale.low) / (scale.high - scale.low)
    index = np.rint(np.clip(np.nan_to_num(share), 0.0, 1.0) * (LEVELS - 1)).astype(np.uint8)
    index[np.isnan(picture)] = LEVELS
    image = Image.fromarray(index, mode="P")
    image.putpalette([*_table(scale.colours).ravel().tolist(), *scale.missing])
    text = PngImagePlugin.PngInfo()
    text.add_text("Comment", comment)
    return _png(image, text)


def gradient(colours: str) -> str:
    """Return a scale as a CSS gradient from left to right."""
    stops = _table(colours)[:: (LEVELS - 1) // 10]
    return f"linear-gradient(90deg,{','.join(f'#{bytes(stop).hex()}' for stop in stops)})"


def reduced(image_rgb: NDArray[np.uint8], *, comment: str, colours: int = 128) -> bytes:
    """Return a drawn figure as a small PNG with at most ``colours`` colours."""
    from PIL import Image, PngImagePlugin

    image = Image.fromarray(image_rgb, mode="RGB").quantize(colours, dither=Image.Dither.NONE)
    text = PngImagePlugin.PngInfo()
    text.add_text("Comment", comment)
    return _png(image, text)


def _png(image: object, text: object) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, format="PNG", optimize=True, pnginfo=text)  # type: ignore[attr-defined]
    return buffer.getvalue()


def _table(colours: str) -> NDArray[np.uint8]:
    from matplotlib import colormaps

    return np.asarray(colormaps[colours](np.linspace(0.0, 1.0, LEVELS), bytes=True)[:, :3])


def _window(pair: Pair) -> tuple[slice, slice]:
    """Return rows and columns round the region, with a margin."""
    margin = 6
    found = []
    for axis in (1, 0):
        seen = np.flatnonzero(pair.region.any(axis=axis))
        size = pair.region.shape[1 - axis]
        first, last = (seen[0], seen[-1]) if seen.size else (0, size - 1)
        found.append(slice(max(int(first) - margin, 0), min(int(last) + 1 + margin, size)))
    return found[0], found[1]


def _blocks(picture: FloatArray) -> FloatArray:
    """Average blocks until no side is longer than `LARGEST`; a block without a number stays NaN."""
    step = -(-max(picture.shape) // LARGEST)
    if step == 1:
        return picture
    rows, columns = (size // step * step for size in picture.shape)
    blocks = picture[:rows, :columns].reshape(rows // step, step, columns // step, step)
    known = np.isfinite(blocks)
    count = known.sum(axis=(1, 3))
    total = np.where(known, blocks, 0.0).sum(axis=(1, 3))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
