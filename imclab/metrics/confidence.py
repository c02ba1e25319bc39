"""How sure a metric is: intervals from repeated frames, or from a calibrated noise model.

A bootstrap over the pixels or blocks of one frame is not offered: it takes the scene for random and
came out 0.5 to 124 times the true frame-to-frame scatter on pictures of known noise.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.errors import Fault, InputError

FEWEST_FRAMES = 10
"""Below this many frames a resampled interval is too narrow to be worth printing."""

Metric = Callable[[ArrayLike, ArrayLike], float]
"""A metric of (simulated picture, measured frame), for instance ``partial(ssim, data_range=255)``."""


@dataclass(frozen=True)
class Interval:
    """A metric with its confidence interval.

    Attributes
    ----------
    value : float
        Mean over the frames, or the value of the one frame.
    low, high : float
        Ends of the interval.
    level : float
        Its confidence.
    stderr : float
        Standard uncertainty of ``value``.
    method : str
        "frames, BCa" or "parametric".
    frames : int
        Frames measured or drawn.
    """

    value: float
    low: float
    high: float
    level: float
    stderr: float
    method: str
    frames: int


def confidence_from_frames(
    metric: Metric,
    simulated: ArrayLike,
    frames: Sequence[ArrayLike] | NDArray[np.float64],
    *,
    level: float = 0.95,
    resamples: int = 4999,
    seed: int = 0,
) -> Interval:
    """Interval of the mean metric over repeated frames of one scene (bootstrap over frames, BCa).

    Parameters
    ----------
    metric : callable
        ``metric(simulated, frame) -> float``.
    simulated : array_like (rows, cols)
        The picture that every frame is held against.
    frames : sequence of array_like (rows, cols)
        At least 10 frames of the same scene.
    level : float
        Wanted confidence, between 0 and 1.
    resamples, seed : int
        Size and seed of the bootstrap.

    Raises
    ------
    InputError
        Too few frames, a level outside (0, 1), a metric that is not finite (PSNR of identical
        pictures).
    """
    _check_level(level)
    if len(frames) < FEWEST_FRAMES:
        advice = "With fewer, draw frames from the calibrated noise: confidence_from_noise."
        raise InputError(
            "confidence", [Fault("frames", str(len(frames)), f"at least {FEWEST_FRAMES}", advice)]
        )
    from scipy.special import ndtr, stdtrit
    from scipy.stats import bootstrap

    # Resampled means spread less than means do, by (n - 1)/n, and know nothing of Student's t: a
    # wider level makes up for both (Hesterberg, The American Statistician 69 (2015) 371).
    count = len(frames)
    wider = float(1 - 2 * ndtr(stdtrit(count - 1, (1 - level) / 2) * np.sqrt(count / (count - 1))))
    values = _values(metric, simulated, frames)
    mean = float(values.mean())
    stderr = float(values.std(ddof=1) / np.sqrt(values.size))
    low = high = mean
    if stderr > 1e-14 * abs(mean):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a degenerate jackknife is judged below
            found = bootstrap(
                (values,),
                np.mean,
                confidence_level=wider,
                n_resamples=resamples,
                method="BCa",
                rng=np.random.default_rng(seed),
            ).confidence_interval
        low, high = float(found.low), float(found.high)
    return Interval(mean, low, high, level, stderr, "frames, BCa", values.size)


def confidence_from_noise(
    metric: Metric,
    simulated: ArrayLike,
    frame: ArrayLike,
    *,
    draw: Callable[[np.random.Generator], ArrayLike],
    draws: int = 200,
    level: float = 0.95,
    seed: int = 0,
) -> Interval:
    """Interval of the metric of one frame, from frames drawn by a noise model (parametric bootstrap).

    Only the scatter of the drawn values about their median is used, laid round the measured value:
    a drawing that adds noise to an already noisy frame shifts the metric, and that shift is no
    uncertainty.

    Parameters
    ----------
    metric, simulated, level, seed
        As in :func:`confidence_from_frames`.
    frame : array_like (rows, cols)
        The one measured frame.
    draw : callable
        ``draw(rng) -> frame``: one frame of the same scene with the calibrated noise.
    draws : int
        How many, at least 10.
    """
    _check_level(level)
    if draws < FEWEST_FRAMES:
        raise InputError("confidence", [Fault("draws", str(draws), f"at least {FEWEST_FRAMES}")])
    rng = np.random.default_rng(seed)
    values = _values(metric, simulated, [draw(rng) for _ in range(draws)])
    value = float(_values(metric, simulated, [frame])[0])
    below, middle, above = np.quantile(values, [(1 - level) / 2, 0.5, (1 + level) / 2])
    stderr = float(values.std(ddof=1))
    return Interval(
        value,
        value - float(above - middle),
        value + float(middle - below),
        level,
        stderr,
        "parametric",
        draws,
    )


def _values(
    metric: Metric, simulated: ArrayLike, frames: Sequence[ArrayLike] | NDArray[np.float64]
) -> NDArray[np.float64]:
    values = np.array([metric(simulated, frame) for frame in frames], dtype=np.float64)
    if not np.isfinite(values).all():
        wanted = "finite values"
        advice = "PSNR of identical pictures is infinite; use the MSE."
        count = int((~np.isfinite(values)).sum())
        raise InputError("confidence", [Fault("metric", f"{count} values NaN or infinite", wanted, advice)])
    return values


def _check_level(level: float) -> None:
    if not 0 < level < 1:
        raise InputError(
            "confidence", [Fault("level", repr(level), "a number between 0 and 1, such as 0.95")]
        )
