"""The fits alone, beside what libraries offer: response from few levels, gain over 400:1, Debevec.

    python -m tests.figures.calibration_fits

Synthetic numbers, no pictures. Printed: rms relative error of the inverse response beside PCHIP,
monotone regression splines and interpolation; error of relative gains beside a chain of ratios and
one exponential; the response of a static scene beside OpenCV's Debevec.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import cv2
import numpy as np
from scipy.interpolate import BSpline, PchipInterpolator
from scipy.optimize import lsq_linear

from calibration.levels import Levels
from calibration.response import fit_jointly

Fit = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def ours(counts: np.ndarray, energy: np.ndarray, at: np.ndarray, full: float) -> np.ndarray:
    """Exposure at counts, by the joint fit."""
    order = np.arange(counts.size)
    levels = Levels(
        counts,
        np.full(counts.size, 0.05),
        np.zeros(counts.size),
        np.zeros(counts.size, np.intp),
        order,
        np.log(energy),
        (1.0,),
        0,
        full,
    )
    fit = fit_jointly(levels)
    return np.exp(PchipInterpolator(fit.log_counts, fit.log_exposure)(np.log(at)))


def pchip(counts: np.ndarray, energy: np.ndarray, at: np.ndarray) -> np.ndarray:
    """PCHIP of log exposure over counts, made to rise."""
    rising = np.maximum.accumulate(counts) + 1e-6 * np.arange(counts.size)
    return np.exp(PchipInterpolator(rising, np.log(np.maximum.accumulate(energy)))(at))


def straight(counts: np.ndarray, energy: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Straight lines in log exposure."""
    return np.exp(np.interp(at, counts, np.log(energy)))


def monotone_spline(counts: np.ndarray, energy: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Cubic B-spline of 8 intervals with rising coefficients (EMVA 1288 General, eq. 44)."""
    low, high = np.log(counts[0]), np.log(counts[-1])
    knots = np.concatenate([[low] * 3, np.linspace(low, high, 9), [high] * 3])
    sums = np.tril(np.ones((11, 11)))
    design = BSpline.design_matrix(np.clip(np.log(counts), low, high), knots, 3).toarray() @ sums
    bounds = (np.r_[-np.inf, np.zeros(10)], np.full(11, np.inf))
    found = lsq_linear(design, np.log(energy), bounds=bounds).x
    return np.exp(BSpline.design_matrix(np.clip(np.log(at), low, high), knots, 3).toarray() @ sums @ found)


def response_rows(repeats: int) -> None:
    """Soft-saturating response, 3 to 90 % of the range (the measurement the fits were chosen by)."""
    sys.stdout.write("inverse response, rms relative error (soft saturation)\n")
    for bits, count, error in ((12, 16, 0.01), (8, 16, 0.01), (12, 40, 0.02), (12, 16, 0.0)):
        full = 2.0**bits - 1
        totals: dict[str, list[float]] = {}
        for seed in range(repeats):
            rng = np.random.default_rng(seed)
            true = np.geomspace(0.012, 1.25, count)
            counts = full * (1 - np.exp(-2.2 * true)) / (1 - np.exp(-2.75))
            counts = np.clip(counts + 0.02 * np.sqrt(full / 4095) * rng.standard_normal(count), 1.0, full)
            stated = true * np.exp(error * rng.standard_normal(count))
            at = np.linspace(max(0.03 * full, counts[0]), 0.9 * full, 300)
            exact = -np.log1p(-at / full * (1 - np.exp(-2.75))) / 2.2
            values = {
                "this fit": ours(counts, stated, at, full),
                "PCHIP": pchip(counts, stated, at),
                "monotone B-spline": monotone_spline(counts, stated, at),
                "straight lines": straight(counts, stated, at),
            }
            for name, value in values.items():
                totals.setdefault(name, []).append(float(np.sqrt(np.mean((value / exact - 1) ** 2))))
        shown = ", ".join(
            f"{name} {100 * np.sqrt(np.mean(np.square(each))):.2f} %" for name, each in totals.items()
        )
        sys.stdout.write(f"  {bits} bit, {count} levels, source {error:.0%}: {shown}\n")


def gain_rows(repeats: int) -> None:
    """Ten voltages over 400:1, wiggle 3 % off the exponential, 1 % lamp and 1 % noise."""
    sys.stdout.write("relative gain over 400:1, error of G(V)/G(V0), median and 95th percentile over all\n")
    for count in (8, 16):
        errors: dict[str, list[float]] = {"joint": [], "chain": [], "exponential": []}
        held: list[bool] = []
        for seed in range(repeats):
            _gain_once(np.random.default_rng(seed), count, errors, held)
        for name, each in errors.items():
            sys.stdout.write(
                f"  {count} levels, {name:12s}{100 * np.median(each):6.2f} % "
                f"{100 * np.quantile(each, 0.95):6.2f} %"
            )
            sys.stdout.write(
                f"  95 % interval holds {100 * np.mean(held):.1f} %\n" if name == "joint" else "\n"
            )


def _gain_once(
    rng: np.random.Generator, count: int, errors: dict[str, list[float]], held: list[bool]
) -> None:
    settings = np.linspace(600.0, 960.0, 10)
    log_gain = np.linspace(0.0, np.log(400.0), 10) + 0.03 * rng.standard_normal(10)
    log_gain -= log_gain[0]
    ladder = np.log(np.geomspace(1e-4, 1.0, 60))
    lamp = 0.01 * rng.standard_normal(ladder.size)
    setting, level, counts = [], [], []
    for index, gain in enumerate(log_gain):
        inside = np.flatnonzero((ladder + gain > np.log(0.02)) & (ladder + gain < np.log(0.9)))
        chosen = inside[np.linspace(0, inside.size - 1, min(count, inside.size)).round().astype(int)]
        for each in chosen:
            exposure = ladder[each] + lamp[each] + gain + 0.01 * rng.standard_normal()
            setting.append(index)
            level.append(each)
            counts.append(4000.0 * (1.0 - np.exp(-1.5 * np.exp(exposure))))
    settings_index, levels_index = np.array(setting), np.array(level)
    used, renumbered = np.unique(levels_index, return_inverse=True)
    measured = np.array(counts)
    fit = fit_jointly(
        Levels(
            measured,
            1e-4 * measured,
            np.zeros(measured.size),
            settings_index,
            renumbered,
            ladder[used],
            tuple(settings),
            0,
            4000.0,
        )
    )
    true = log_gain
    stderr = np.sqrt(np.diag(fit.covariance)[-10:])
    errors["joint"].append(float(np.sqrt(np.mean((fit.log_gain[1:] - true[1:]) ** 2))))
    held.extend(np.abs(fit.log_gain[1:] - true[1:]) <= 1.96 * stderr[1:])
    linear = np.log(-np.log1p(-measured / 4000.0) / 1.5)  # the peers get the true response for nothing
    chain = [0.0]
    for index in range(1, 10):
        shared = np.intersect1d(
            levels_index[settings_index == index], levels_index[settings_index == index - 1]
        )
        each = [
            linear[(settings_index == index) & (levels_index == lv)][0]
            - linear[(settings_index == index - 1) & (levels_index == lv)][0]
            for lv in shared
        ]
        single = linear - ladder[levels_index]
        step = (
            np.mean(each)
            if each
            else (single[settings_index == index].mean() - single[settings_index == index - 1].mean())
        )
        chain.append(chain[-1] + float(step))
    errors["chain"].append(float(np.sqrt(np.mean((np.array(chain[1:]) - true[1:]) ** 2))))
    slope, start = np.polyfit(settings, fit.log_gain, 1)
    law = slope * settings + start
    errors["exponential"].append(float(np.sqrt(np.mean((law[1:] - law[0] - true[1:]) ** 2))))


def scene_rows(repeats: int) -> None:
    """An unknown static scene, 8 bit, 9 exposures with known ratios: this fit and OpenCV's Debevec."""
    sys.stdout.write("response of an unknown static scene, 8 bit, 9 exposures; rms over 5 to 95 % of range\n")
    for noise in (0.0, 1.0):
        totals: dict[str, list[float]] = {"this fit": [], "Debevec": []}
        for seed in range(repeats):
            mine, theirs = _scene_once(np.random.default_rng(seed), noise)
            totals["this fit"].append(mine)
            totals["Debevec"].append(theirs)
        shown = ", ".join(f"{name} {100 * np.mean(each):.2f} %" for name, each in totals.items())
        sys.stdout.write(f"  noise {noise:.0f} DN: {shown}\n")


def _scene_once(rng: np.random.Generator, noise: float) -> tuple[float, float]:
    smooth = cv2.GaussianBlur(rng.standard_normal((64, 64)), (0, 0), 4.0)
    radiance = np.exp(1.5 * smooth / smooth.std())
    times = 2.0 ** np.arange(-4.0, 5.0)

    def respond(exposure: np.ndarray) -> np.ndarray:
        return 255.0 * (1.0 - np.exp(-exposure)) ** 0.7

    images = [
        np.clip(np.rint(respond(radiance * t) + noise * rng.standard_normal(radiance.shape)), 0, 255).astype(
            np.uint8
        )
        for t in times
    ]
    curve = cv2.createCalibrateDebevec(70, 10.0).process(images, times.astype(np.float32)).ravel()
    grey = np.arange(13, 243)
    true = np.log(-np.log1p(-((grey / 255.0) ** (1 / 0.7))))
    picked = rng.choice(radiance.size, 70, replace=False)
    stack = np.stack([image.ravel()[picked] for image in images]).astype(float)
    inside = (stack > 2) & (stack < 253)
    setting, pixel = np.nonzero(inside)
    used, level = np.unique(pixel, return_inverse=True)
    energy = np.full(used.size, np.nan)
    energy[0] = 0.0
    log_times = np.log(times)
    counts = stack[inside]
    fit = fit_jointly(
        Levels(
            counts,
            np.full(counts.size, np.hypot(noise, 0.29)),
            np.zeros(counts.size),
            setting,
            level,
            energy,
            tuple(times),
            4,
            255.0,
            known_log_gain=log_times - log_times[4],
            known_stderr=1e-4,
        )
    )
    mine = PchipInterpolator(fit.log_counts, fit.log_exposure)(np.log(grey))

    def error(values: np.ndarray) -> float:
        rest = values - true
        return float(np.std(rest))

    return error(mine), error(np.log(curve[grey]))


def main() -> None:
    """Print all three tables."""
    response_rows(40)
    gain_rows(20)
    scene_rows(5)


if __name__ == "__main__":
    main()
