"""Do the stated errors hold the truth? ``python -m tests.figures.coverage [RUNS]``.

Many runs of 32 batches, at optical depths 0.42, 1.42 and 4, gated; the truth of a run is the mean of all
runs. Of normal means with 31 degrees of freedom 67.5 % lie within one stated error, 94.6 % within two.
"""

from __future__ import annotations

import math
import sys

import numpy as np

from imclab.transport import two_sided
from imclab.transport.setup import setup_of
from tests.imaging_scenes import CENTRED, scene

DEPTHS = (0.42, 1.42, 4.0)
BATCHES, PACKETS, PIXELS = 32, 512, 16


def covered(values: np.ndarray) -> tuple[float, float]:
    """Return the shares of runs (runs, batches, quantities) within one and two stated errors."""
    mean = values.mean(axis=1)
    error = values.std(axis=1, ddof=1) / math.sqrt(values.shape[1])
    off = np.abs(mean - mean.mean(axis=0)) / error
    return float(np.mean(off < 1.0)), float(np.mean(off < 2.0))


def main(runs: int) -> None:
    """Print the shares for totals and pixels at each depth."""
    for depth in DEPTHS:
        side = scene(depth, gate=CENTRED, aperture=0.05, side=0.1, pixels=PIXELS)
        batch = two_sided.make(setup_of(side)).batch
        totals, pixels = np.empty((runs, BATCHES, 1)), np.empty((runs, BATCHES, PIXELS))
        for run in range(runs):
            for i in range(BATCHES):
                tally = batch(run, i * PACKETS, PACKETS)
                picture = tally["target"] + tally["backscatter"]
                totals[run, i], pixels[run, i] = picture.sum(), np.diagonal(picture)
        (one, two), (pixel_one, pixel_two) = covered(totals), covered(pixels)
        print(
            f"depth {depth}, {runs} runs: total within one error {100 * one:.1f} %, two {100 * two:.1f} %; "
            f"pixels {100 * pixel_one:.1f} %, {100 * pixel_two:.1f} %",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
