"""How a simulated picture looks through water and camera, as a sum of known fields.

Symbols: R the simulated picture through the motion and the blur; H and V the same through a wide
and a very wide blur (halo and veil); u, v the place in the frame, about -1 to 1.

    brightness = background(u, v) + R·i(u, v) + d R² + e R³ + H·(f + g u + h v) + k V + m R H

The polynomials are quadratic (illumination i) and cubic (background). The powers of R and the
product R H stand for the tone curve of the camera, which bends what has already been blurred.
Everything is linear in the amplitudes, and the first ``PLAIN`` terms alone are a fair first model.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

BACKGROUND = 6
PLAIN = 11
FULL = 23

_SPREADS = np.array([*[0.5] * 2, 1.0, 0.7, *[np.inf] * 4, *[0.3] * 3, 0.5, 0.7, *[0.3] * 2, 0.5])
"""How strong terms 7 to 22 may be beside the figure: standard deviations in units of its contrast.

Light that falls off by half across the target, a halo of the figure's own strength, a tone curve
between square root and square. The background is left free, whatever its strength."""


class Fields(NamedTuple):
    """The fields at the pixels: value, slope in x, slope in y, Laplacian, each (4, n)."""

    sharp: Vector
    halo: Vector
    veil: Vector
    u: Vector
    v: Vector


def terms(fields: Fields, count: int) -> Vector:
    """Return the first ``count`` terms of the model (count, n), background first."""
    u, v = fields.u, fields.v
    figure, halo, veil = fields.sharp[0], fields.halo[0], fields.veil[0]
    square = figure * figure
    out = [np.ones_like(u), u, v, u * u, u * v, v * v]
    out += [figure, figure * u, figure * v, square, halo]
    if count > PLAIN:
        out += [u * out[3], v * out[3], u * out[5], v * out[5]]
        out += [figure * out[3], figure * out[4], figure * out[5], figure * square]
        out += [figure * halo, halo * u, halo * v, veil]
    return np.stack(out)


def ridge(linear: Vector, amplitudes: Vector, noise: float, count: int = FULL) -> Vector:
    """Return what the square of each of ``count`` amplitudes costs.

    ``noise`` is the variance of an independent pixel of a frame that ``linear`` and ``amplitudes``
    were fitted to. Shrinks towards the simplest appearance where the frame says nothing of the others.
    """
    figure = amplitudes[BACKGROUND:]
    # Cubic background terms stand between those of the figure.
    figure = np.where(np.isin(np.arange(figure.size), (5, 6, 7, 8)), 0.0, figure)
    contrast = float(np.std(figure @ linear[BACKGROUND:])) / max(float(np.std(linear[BACKGROUND])), 1e-300)
    out = np.zeros(FULL)
    out[BACKGROUND + 1 :] = noise / (_SPREADS * max(contrast, 1e-300)) ** 2
    return out[:count]


def slopes(fields: Fields, amplitudes: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the derivatives of the brightness by x, by y and by the variance of the blur.

    Derivatives by the place in the simulated picture; a Gaussian blur of variance t obeys the
    diffusion equation, dR/dt = (d²R/dx² + d²R/dy²)/2.
    """
    a = np.zeros(FULL)
    a[: amplitudes.size] = amplitudes
    u, v = fields.u, fields.v
    figure, halo = fields.sharp[0], fields.halo[0]
    by_figure = a[6] + a[7] * u + a[8] * v + 2 * a[9] * figure
    by_halo = np.full_like(u, a[10])
    if amplitudes.size > PLAIN:
        by_figure += (
            a[15] * u * u + a[16] * u * v + a[17] * v * v + 3 * a[18] * figure * figure + a[19] * halo
        )
        by_halo += a[19] * figure + a[20] * u + a[21] * v
    by_x, by_y = (
        by_figure * fields.sharp[k] + by_halo * fields.halo[k] + a[22] * fields.veil[k] for k in (1, 2)
    )
    return by_x, by_y, by_figure * fields.sharp[3] / 2
