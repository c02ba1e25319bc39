"""What a registration gives: the motion, how sure it is, and whether to believe it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.errors import Fault, InputError
from imclab.registration.motion import Frame, Matrix, displacements, moved, moved_back, parameters_between


@dataclass(frozen=True)
class Registration:
    """A motion from a simulated picture to a measured frame.

    Attributes
    ----------
    matrix : float64 array (3, 3), read-only
        Maps pixel centres (x, y, 1) of the simulated picture to pixel centres of the frame; pixel
        (0, 0) is at (0.0, 0.0); the convention of ``cv2.findTransformECC(fixed, moving)``. NaN when
        nothing was found.
    model : str
        "translation", "euclidean", "similarity", "affine" or "homography".
    ok : bool
        Whether the frame shows the target there.
    reason : str
        Why not; empty when ok.
    quality : float
        Share of the frame's structure, beyond its background, that the moved and blurred picture
        explains with one amplitude, on coarse pixels: 1 is all; negative for a reversed picture.
    contrast : float
        Strength of the target in the frame, in standard deviations of the noise.
    covariance : float64 array (k, k), read-only
        Covariance of the motion's parameters, in units of the target's radius.
    stderr_px : float
        Standard uncertainty of a mapped corner of the simulated picture: root mean square distance
        over the four corners, in pixels of the frame.
    corner_stderr_px : float64 array (4,), read-only
        The same for each corner: top left, top right, bottom left, bottom right.
    target_stderr_px : float
        The same over the pixels of the target, which is what a comparison needs.
    blur_px : float
        Standard deviation of the fitted blur, in pixels of the simulated picture.
    fixed_shape, moving_shape : tuple of int
        (rows, cols) of the two pictures.
    frame : Frame
        Origin and unit of the parameters.
    """

    matrix: Matrix
    model: str
    ok: bool
    reason: str
    quality: float
    contrast: float
    covariance: NDArray[np.float64]
    stderr_px: float
    corner_stderr_px: NDArray[np.float64]
    target_stderr_px: float
    blur_px: float
    fixed_shape: tuple[int, int]
    moving_shape: tuple[int, int]
    frame: Frame

    def warp(self, moving: ArrayLike, *, fill: float = 0.0) -> NDArray[np.float64]:
        """Resample a measured frame on the grid of the simulated picture, to look at.

        Not for metrics: resampling smooths the noise and flatters them; use :meth:`warp_fixed`.

        Parameters
        ----------
        moving : array_like (rows, cols)
            A frame of the registered shape.
        fill : float
            Value where the frame has no pixel.
        """
        picture = self._checked(moving, "moving", self.moving_shape)
        rows, cols = self.fixed_shape
        y, x = np.mgrid[:rows, :cols].astype(np.float64)
        place = moved(self.matrix, np.column_stack([x.ravel(), y.ravel()]))
        return _resampled(picture, place[:, 0], place[:, 1], fill).reshape(rows, cols)

    def warp_fixed(self, fixed: ArrayLike, *, fill: float = np.nan) -> NDArray[np.float64]:
        """Resample the simulated picture on the grid of the measured frame, for comparison.

        Each pixel of the frame takes the mean over its area when it covers more than one pixel of
        the picture. Values are brightness: energies per pixel must also be scaled by the ratio of
        the pixel areas.

        Parameters
        ----------
        fixed : array_like (rows, cols)
            A simulated picture of the registered shape.
        fill : float
            Value outside the simulated picture.
        """
        picture = self._checked(fixed, "fixed", self.fixed_shape)
        rows, cols = self.moving_shape
        y, x = (place.ravel() for place in np.mgrid[:rows, :cols].astype(np.float64))
        zoom = np.sqrt(abs(np.linalg.det(self.matrix[:2, :2])))
        parts = int(np.clip(np.ceil(1 / zoom - 0.05), 1, 8))
        offsets = (np.arange(parts) + 0.5) / parts - 0.5
        total = np.zeros(x.size)
        for down in offsets:
            for across in offsets:
                total += _resampled(picture, *moved_back(self.matrix, x + across, y + down), fill)
        return (total / parts**2).reshape(rows, cols)

    def point_stderr_px(self, points: ArrayLike) -> NDArray[np.float64]:
        """Standard uncertainty (n,) of mapped points (n, 2), each a root mean square distance."""
        places = np.asarray(points, dtype=np.float64)
        slope = displacements(self.matrix, places, self.frame, len(self.covariance))
        return np.asarray(np.sqrt(np.einsum("nik,kl,nil->n", slope, self.covariance, slope)))

    def squared_distance(self, matrix: ArrayLike) -> float:
        """Squared Mahalanobis distance of another motion; χ² with ``len(covariance)`` degrees when true."""
        step = parameters_between(self.matrix, np.asarray(matrix, dtype=np.float64), self.frame)
        used = step[: len(self.covariance)]
        return float(used @ np.linalg.solve(self.covariance, used))

    def _checked(self, picture: ArrayLike, name: str, shape: tuple[int, int]) -> NDArray[np.float64]:
        array = np.asarray(picture, dtype=np.float64)
        if array.shape != shape:
            raise InputError(
                "registration", [Fault(name, f"shape {array.shape}", f"the registered shape {shape}")]
            )
        if not np.isfinite(self.matrix).all():
            raise InputError(
                "registration", [Fault("matrix", "no motion", "a registration that found one", self.reason)]
            )
        return array


def _resampled(
    picture: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64], fill: float
) -> NDArray[np.float64]:
    from scipy.ndimage import map_coordinates

    rows, cols = picture.shape
    order = 3 if np.isfinite(picture).all() else 1  # a spline would spread one NaN everywhere
    values = map_coordinates(picture, [y, x], order=order, mode="nearest")
    inside = (x >= -0.5) & (x <= cols - 0.5) & (y >= -0.5) & (y <= rows - 0.5)
    return np.where(inside, values, fill)
