"""Pictures in counts and their quality, each with its standard error.

The energies become counts through the detector of the study file. Its gain is the paper's unprinted
choice; ours is stated: the reference picture's 99th percentile comes to lie at `BRIGHTEST` of full
scale, and the compared picture is taken at the same gain. ``own gain`` beside it raises the compared
picture to the same brightness, as the experiment did.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imclab import metrics
from imclab.detector import IntensifiedCamera
from imclab.scene import Detector
from imclab.study.curves import Point, shown_value
from imclab.study.file import Study
from imclab.uncertainty import Estimate

FloatArray = NDArray[np.float64]
Metric = Callable[..., float]

SAME_GAIN, OWN_GAIN = "same gain", "own gain"
GAINS = (SAME_GAIN, OWN_GAIN)
BRIGHTEST = 0.8
PERCENTILE = 99.0
DRAWS = 12
METRICS: dict[str, Metric] = {
    "ssim": metrics.ssim,
    "mssim": metrics.mssim,
    "luminance_mssim": metrics.luminance_mssim,
    "psnr_db": metrics.psnr,
}


@dataclass(frozen=True)
class Shot:
    """A picture in counts, and copies of it with the noise of simulation and camera drawn again."""

    counts: FloatArray
    redrawn: tuple[FloatArray, ...]
    full_scale: int


@dataclass(frozen=True)
class Pair:
    """A picture compared with the reference picture of its curve."""

    curve: str
    light: str
    value: str
    gain: str
    metrics: dict[str, Estimate]


def pairs_of(study: Study, name: str, points: list[Point]) -> list[Pair]:
    """Return every later picture of a curve compared with its first, at both gains."""
    gated = name.endswith(", gated")
    lights = (
        {"through the gate": "energy", "target light alone": "target"} if gated else {"no gate": "energy"}
    )
    pairs = []
    for light, part in lights.items():
        brightest = [brightest_of(point, part) for point in points]
        reference = shot_of(study.detector, points[0], part, brightest[0])
        for point, own in zip(points[1:], brightest[1:], strict=True):
            for gain, scale in ((SAME_GAIN, brightest[0]), (OWN_GAIN, own)):
                shot = shot_of(study.detector, point, part, scale)
                compared = _compared(reference, shot)
                pairs.append(Pair(name, light, shown_value(study, point), gain, compared))
    return pairs


def brightest_of(point: Point, part: str) -> float:
    """Return the energy (J per pixel) that comes to lie at `BRIGHTEST` of full scale."""
    return float(np.percentile(getattr(point.result, part), PERCENTILE))


def shot_of(detector: Detector, point: Point, part: str, brightest: float) -> Shot:
    """Take the picture; ``brightest`` (J per pixel) comes to lie at `BRIGHTEST` of full scale."""
    chain = IntensifiedCamera(
        wavelength=point.scene.laser.wavelength,
        quantum_efficiency=detector.quantum_efficiency,
        excess_noise_factor=detector.excess_noise_factor,
        blur_fwhm_px=detector.blur_fwhm_px,
        dark_counts=detector.dark_counts,
        read_noise_counts=detector.read_noise_counts,
        response_exponent=detector.response_exponent,
        bit_depth=detector.bit_depth,
    )
    chain = replace(chain, gain=BRIGHTEST * chain.full_scale / float(chain.photoelectrons(brightest)))
    energy, stderr = getattr(point.result, part), getattr(point.result, f"{part}_stderr")
    rng = np.random.default_rng(point.result.seed)

    def take(light: FloatArray) -> FloatArray:
        return chain.draw(np.maximum(light, 0.0), rng).astype(float)

    counts = take(energy)
    redrawn = tuple(take(energy + stderr * rng.standard_normal(energy.shape)) for _ in range(DRAWS))
    return Shot(counts, redrawn, chain.full_scale)


def _compared(reference: Shot, shot: Shot) -> dict[str, Estimate]:
    found = {}
    for name, metric in METRICS.items():
        value = metric(reference.counts, shot.counts, data_range=reference.full_scale)
        drawn = [
            metric(one, other, data_range=reference.full_scale)
            for one, other in zip(reference.redrawn, shot.redrawn, strict=True)
        ]
        found[name] = Estimate(value, float(np.std(drawn, ddof=1)))
    return found
