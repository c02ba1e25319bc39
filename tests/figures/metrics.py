"""Measure the metrics: ``python -m tests.figures.metrics``.

Prints the difference to the literal double loop and to scikit-image, the time of MSSIM beside
scikit-image's in the same run, and the coverage of the intervals.
"""

from __future__ import annotations

import time
from functools import partial

import numpy as np
from skimage.metrics import structural_similarity

from imclab import metrics
from tests.oracles_metrics import literal_mssim, literal_ssim


def reference(x: np.ndarray, y: np.ndarray, level: float) -> float:
    """Wang's settings of scikit-image."""
    return float(
        structural_similarity(
            x, y, data_range=level, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
        )
    )


def pair(size: int, level: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = level * rng.random((size, size))
    return x, np.clip(0.8 * x + 0.2 * level * rng.random((size, size)), 0, level)


def measure_values() -> None:
    worst = {"mssim, loop": 0.0, "ssim, loop": 0.0, "mssim, scikit-image": 0.0}
    for seed, level in enumerate((1.0, 255.0, 4095.0, 65535.0)):
        x, y = pair(64, level, seed)
        ours = metrics.mssim(x, y, data_range=level)
        found = (
            ours - literal_mssim(x, y, level),
            metrics.ssim(x, y, data_range=level) - literal_ssim(x, y, level),
            ours - reference(x, y, level),
        )
        worst = {name: max(value, abs(gap)) for (name, value), gap in zip(worst.items(), found, strict=True)}
    print("largest differences:", ", ".join(f"{name} {value:.1e}" for name, value in worst.items()))


def measure_speed() -> None:
    for size in (200, 512, 2048):
        x, y = pair(size, 255.0)
        calls = {
            "ours": partial(metrics.mssim, x, y, data_range=255),
            "theirs": partial(reference, x, y, 255.0),
        }
        spent: dict[str, list[float]] = {name: [] for name in calls}
        metrics.mssim(x, y, data_range=255)  # compile, or load from the cache
        assert abs(metrics.mssim(x, y, data_range=255) - reference(x, y, 255.0)) < 1e-10
        for _ in range(15 if size < 2000 else 4):
            for name, metric in calls.items():
                begin = time.process_time()
                metric()
                spent[name].append(time.process_time() - begin)
        ours, theirs = (1e3 * float(np.median(spent[name])) for name in ("ours", "theirs"))
        print(f"MSSIM at {size} px: {ours:.2f} ms, scikit-image {theirs:.1f} ms, {theirs / ours:.1f} times")


def measure_coverage(repeats: int = 200) -> None:
    rng = np.random.default_rng(1)
    clean = 255 * rng.random((12, 12))
    metric = partial(metrics.psnr, data_range=255)

    def draw(source: np.random.Generator) -> np.ndarray:
        return clean + source.normal(0, 20, clean.shape)

    truth = float(np.mean([metric(clean, draw(rng)) for _ in range(5000)]))
    for frames in (10, 20):
        inside = 0
        for seed in range(repeats):
            found = metrics.confidence_from_frames(
                metric, clean, [draw(rng) for _ in range(frames)], resamples=999, seed=seed
            )
            inside += found.low <= truth <= found.high
        print(
            f"95 % interval of the mean PSNR, {frames} frames: truth inside in {100 * inside / repeats:.1f} %"
        )
    inside = 0
    for seed in range(repeats):
        one = metrics.confidence_from_noise(metric, clean, draw(rng), draw=draw, draws=100, seed=seed)
        inside += one.low <= truth <= one.high
    print(
        f"95 % interval of one frame from its noise model holds the truth in {100 * inside / repeats:.1f} %"
    )


def main() -> None:
    measure_values()
    measure_speed()
    measure_coverage()


if __name__ == "__main__":
    main()
