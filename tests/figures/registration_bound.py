"""What is reachable: ``python -m tests.figures.registration_bound --pairs 300 --first 9000``.

The Cramér–Rao bound of corner errors for the pairs of ``tests.figures.registration``, from the true
motion, light and noise (white grain and speckle, its strength growing with brightness). With the
appearance known, and with that of the generator's family unknown (two dozen linear fields); with and
without the spread of the generator's own motions as a prior. Errors are drawn from the bound's
covariance, so that medians, percentiles and failures compare with measured ones.
"""

from __future__ import annotations

import argparse
import copy
from collections.abc import Iterator

import cv2
import numpy as np

from imclab.registration.motion import PARAMETERS, Frame, displacements, stepped
from tests.figures.registration import pairs_labels
from tests.registration_pairs import (
    BANDS,
    SPECKLE_PX,
    SPECKLE_SHARE,
    Pair,
    Scene,
    brightness,
    make_scene,
    noise_strength,
    through,
)

FRAME = Frame(99.5, 99.5, 50.0)
CORNERS = np.array([[0, 0], [199, 0], [0, 199], [199, 199]], float)
DRAWS = 400
PRIOR = np.array([0, 0, 0, 0, *[0.06 / np.sqrt(6)] * 2, *[6e-4 / np.sqrt(3) * FRAME.radius] * 2])
"""Standard deviation of stretch, shear and perspectives that the generator draws; 0 for no prior."""


def scenes(count: int, first: int) -> Iterator[tuple[Pair, Scene]]:
    """The scenes behind the first ``count`` pairs."""
    for k, label in enumerate(pairs_labels(count, first)):
        seed = first + k // len(BANDS)
        dark = seed % 4 == 3
        yield (
            label,
            make_scene(seed, band=label.band, snr_db=label.snr_db, target=label.target, dark=dark),
        )


def whitened(field: np.ndarray, strength: np.ndarray, share: float) -> np.ndarray:
    """Divide by the noise's strength and by the root of its spectrum."""
    rows, cols = (np.fft.fftfreq(size) * size for size in field.shape)
    distance = rows[:, None] ** 2 + cols[None] ** 2
    correlation = (1 - share) * (distance == 0) + share * np.exp(-distance / (4 * SPECKLE_PX**2))
    spectrum = np.fft.fft2(correlation).real
    return np.fft.ifft2(np.fft.fft2(field / strength) / np.sqrt(spectrum)).real


def appearance(light: np.ndarray) -> list[np.ndarray]:
    """Fields that an unknown background, illumination, tone, halo, veil and blur can add."""
    rows, cols = light.shape
    v, u = np.mgrid[:rows, :cols]
    u, v = 2 * u / cols - 1, 2 * v / rows - 1
    sharp, halo, veil = (cv2.GaussianBlur(light, (0, 0), width) for width in (1.0, 10.0, 20.0))
    one, by_blur = np.ones(light.shape), cv2.GaussianBlur(light, (0, 0), 1.1) - sharp
    out = [one, u, v, u * u, u * v, v * v, u**3, u * u * v, u * v * v, v**3]
    out += [sharp * field for field in (one, u, v, u * u, u * v, v * v, sharp, sharp * sharp, halo)]
    return [*out, halo, halo * u, halo * v, veil, by_blur]


def bounds(label: Pair, scene: Scene) -> dict[str, np.ndarray]:
    """Draw mean corner errors from each bound."""

    def picture(matrix: np.ndarray, largest: float | None) -> tuple[np.ndarray, float]:
        return brightness(copy.deepcopy(scene.rng), through(scene.albedo, matrix, scene.shape), largest)

    count, step = PARAMETERS[label.model], 2e-3
    truth, largest = picture(scene.matrix, None)
    strength = noise_strength(truth, label.snr_db)
    share = float(np.mean(SPECKLE_SHARE))
    slopes = []
    for change in np.eye(count) * step:
        up, down = (picture(stepped(scene.matrix, sign * change, FRAME), largest)[0] for sign in (1, -1))
        slopes.append(whitened((up - down) / (2 * step), strength, share).ravel())
    light = through(scene.albedo, scene.matrix, scene.shape)
    others = [whitened(field, strength, share).ravel() for field in appearance(light)]
    basis = np.linalg.qr(np.array(others).T)[0]
    known = np.array(slopes)
    unknown = known - (known @ basis) @ basis.T
    prior = np.diag([1 / sd**2 if sd > 0 else 0.0 for sd in PRIOR[:count]])
    slope = displacements(scene.matrix, CORNERS, FRAME, count)
    rng = copy.deepcopy(scene.rng)
    out = {}
    for name, used, extra in (
        ("appearance unknown", unknown, 0 * prior),
        ("unknown, prior", unknown, prior),
        ("known, prior", known, prior),
    ):
        covariance = np.linalg.inv(used @ used.T + extra)
        drawn = rng.multivariate_normal(np.zeros(count), covariance, DRAWS)
        out[name] = np.linalg.norm(np.einsum("nik,sk->sni", slope, drawn), axis=2).mean(axis=1)
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=300)
    parser.add_argument("--first", type=int, default=9000)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    labels, rows = [], []
    for label, scene in scenes(options.pairs, options.first):
        labels.append(label)
        rows.append(bounds(label, scene))
    for name in rows[0]:
        errors = np.array([row[name] for row in rows])
        for band in ("all", *BANDS):
            some = errors[[band in ("all", label.band) for label in labels]]
            tail = np.quantile(some, 0.95, axis=0)
            fails = (some > 5).sum(axis=0)
            print(
                f"{name:>18} {band:>10} n {len(some):4d} | corner median {np.median(some):.3f} "
                f"p95 {tail.mean():.2f} +- {tail.std():.2f} | fail {fails.mean():.1f} +- {fails.std():.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
