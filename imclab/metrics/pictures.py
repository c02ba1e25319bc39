"""What the metrics accept: two real pictures of one shape, a data range, perhaps a mask."""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.errors import Fault, InputError


class DataRangeWarning(UserWarning):
    """The data range does not fit the pictures; the metric is computed, but means little."""


class Pair(NamedTuple):
    """Two checked pictures in float64 and the pixels that count (None: all of them)."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    mask: NDArray[np.bool_] | None

    def pixels(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the values of both pictures where they count, as two lists of pixels."""
        if self.mask is None:
            return self.x.ravel(), self.y.ravel()
        return self.x[self.mask], self.y[self.mask]


def checked_pair(x: ArrayLike, y: ArrayLike, *, mask: ArrayLike | None = None) -> Pair:
    """Check two pictures and a mask, and turn the pictures into float64 (so nothing wraps round).

    Pixels outside the mask may be anything, NaN too; they come back as zero.

    Raises
    ------
    InputError
        Telling all faults together: complex or non-numeric pixels, not two-dimensional, empty,
        different shapes, pixels that are not finite, a mask of another shape or without a pixel.
    """
    arrays = {"x": np.asarray(x), "y": np.asarray(y)}
    faults = [fault for name, array in arrays.items() for fault in _faults_of_picture(name, array)]
    first, second = arrays.values()
    if not faults and first.shape != second.shape:
        faults.append(
            Fault("x and y", f"shapes {first.shape} and {second.shape}", "one shape", "Register first.")
        )
    keep = None if mask is None else np.asarray(mask)
    if not faults and keep is not None:
        faults.extend(_faults_of_mask(keep, first.shape))
    if not faults:
        for name, array in arrays.items():
            counted = array if keep is None else array[keep]
            bad = int(counted.size - np.isfinite(counted).sum()) if counted.dtype.kind == "f" else 0
            if bad:
                faults.append(
                    Fault(
                        name, f"{bad} pixels of {counted.size} NaN or infinite", "finite pixels", "Mask them."
                    )
                )
    if faults:
        raise InputError("metrics", faults)
    floats = [np.ascontiguousarray(array, dtype=np.float64) for array in (first, second)]
    if keep is not None:
        floats = [np.where(keep, array, 0.0) for array in floats]
    return Pair(floats[0], floats[1], keep)


def checked_range(data_range: float) -> float:
    """Return the data range as a float; raise InputError unless it is finite and positive."""
    try:
        value = float(data_range)
    except (TypeError, ValueError):
        value = float("nan")
    if not (np.isfinite(value) and value > 0):
        raise InputError(
            "metrics",
            [
                Fault(
                    "data_range",
                    repr(data_range),
                    "one positive finite number",
                    "255 for 8 bit, 4095 for 12 bit, the full scale in the pictures' own unit for float.",
                )
            ],
        )
    return value


def range_advice(x: ArrayLike, y: ArrayLike, *, data_range: float) -> str:
    """Say why a data range cannot be the one of two pictures; empty when it may well be.

    The stabilising constants of SSIM and the peak of PSNR scale with the range: a range too large
    drives every SSIM to 1 (255 for pictures of 0 to 1, 65535 for 8-bit data), one too small makes
    it noisy. The range itself cannot be guessed from the pictures, only doubted.
    """
    arrays = [np.asarray(x), np.asarray(y)]
    low = min(float(array.min()) for array in arrays)
    high = max(float(array.max()) for array in arrays)
    if high == low:
        return ""
    integers = all(array.dtype.kind in "iu" for array in arrays)
    widest = max(float(np.iinfo(array.dtype).max) for array in arrays) if integers else np.inf
    span = high - min(low, 0.0)
    told = f"data range {data_range:g} for pictures from {low:g} to {high:g}"
    if data_range > widest:
        return f"{told}: their type ends at {widest:g}, so every SSIM comes out near 1"
    if span > (1.0 if integers else 2.0) * data_range:
        return f"{told}: the pictures exceed it"
    if span < data_range / 128:
        return f"{told}: the pictures fill less than 1/128 of it, so every SSIM comes out near 1"
    if not integers and data_range == 2.0 and low >= 0.0 and high <= 1.0:
        return f"{told}: 2 is a library's guess for floats from -1 to 1"
    return ""


def warn_of_range(x: ArrayLike, y: ArrayLike, *, data_range: float) -> None:
    """Warn with DataRangeWarning, from the caller of the metric, when the range cannot be right."""
    advice = range_advice(x, y, data_range=data_range)
    if advice:
        warnings.warn(advice, DataRangeWarning, stacklevel=3)


def _faults_of_picture(name: str, array: NDArray[Any]) -> list[Fault]:
    if array.dtype.kind not in "biuf":
        wanted = "real numbers (8 to 16 bit integers or floats)"
        return [Fault(name, f"pixels of type {array.dtype}", wanted, "Compare the magnitude or one part.")]
    if array.ndim != 2 or array.size == 0:
        return [
            Fault(
                name, f"shape {array.shape}", "one grey picture (rows, cols)", "Choose a channel or a frame."
            )
        ]
    return []


def _faults_of_mask(mask: NDArray[Any], shape: tuple[int, ...]) -> list[Fault]:
    if mask.dtype != np.bool_:
        return [Fault("mask", f"type {mask.dtype}", "bool, True where a pixel counts")]
    if mask.shape != shape:
        return [Fault("mask", f"shape {mask.shape}", f"the pictures' shape {shape}")]
    if not mask.any():
        return [Fault("mask", "no pixel", "at least one pixel that counts")]
    return []
