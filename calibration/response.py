"""Response, intensifier gain and light levels, solved together in logarithms.

Every run of frames i, taken at setting s and light level l, says one thing:

    log r(y_i) = log E_l + delta_l + log G_s + eps_i

with y the mean counts above dark, r the exposure that gives y at the reference setting, E the
stated energy, delta the error of the source at that level (shared by all settings), eps the error
of that run, G the gain relative to the reference. It is linear in the unknowns log r (a natural
cubic spline in the counts), log G and delta: one weighted least-squares problem with a full
covariance. The bend of the curve and the two error sizes are not tuned but averaged over what the
data allow (restricted likelihood with the spline's bending as a Gaussian prior: the Bayesian
smoothing spline of Wahba 1983, J. R. Stat. Soc. B 45, 133), so the stated intervals hold.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize
from scipy.interpolate import CubicSpline, PchipInterpolator

from calibration.levels import SHIFT_ERROR, Levels, straightened

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]

NODES = 48
ROUNDS = 2
UNKNOWN = 10.0  # standard deviation of the logarithm of a level that nobody stated
BENDS = (0.0, 0.5, 1.0)  # how much of log(1 - y/top) goes into the coordinate the spline is smooth in


@dataclass(frozen=True)
class JointFit:
    """Response and gains with their joint covariance.

    ``log_exposure`` at ``log_counts`` (nodes) and ``log_gain`` per setting; ``covariance`` is over
    (nodes, settings). ``residual`` is that of each run, ``scatter`` its expected size; ``counts``
    are those of the runs with the bend's effect on noisy light taken off.
    """

    log_counts: Floats
    log_exposure: Floats
    log_gain: Floats
    covariance: Floats
    residual: Floats
    scatter: Floats
    counts: Floats
    level_stderr: float
    run_stderr: float
    notes: tuple[str, ...] = field(default=())


class _Design(NamedTuple):
    """The linear problem in one coordinate of the counts."""

    matrix: Floats  # runs x (nodes + settings - 1)
    target: Floats
    noise: Floats  # of the counts, as relative exposure, squared
    level: Integers
    levels: int
    known: NDArray[np.bool_]
    bending: Floats  # penalty over the nodes
    log_bending: float  # logarithm of its pseudo-determinant
    gain_precision: Floats
    gain_pull: Floats


class _Solution(NamedTuple):
    value: float  # minus twice the restricted log likelihood, with the weak priors
    mean: Floats
    covariance: Floats


def fit_jointly(levels: Levels) -> JointFit:
    """Solve response and gains together.

    Returns
    -------
    JointFit
        Means and covariance, averaged over the bending and error sizes that the data allow.
    """
    middle = float(np.nanmean(levels.log_energy))
    levels = replace(levels, log_energy=levels.log_energy - middle)
    measured = levels
    slope = np.ones(levels.counts.size)
    centres: dict[float, Floats] = {}
    for _ in range(ROUNDS):  # slope and bend of the curve enter the weights and the means it is solved from
        nodes = _place_nodes(levels)
        designs = {bend: _design(levels, nodes, slope, bend) for bend in BENDS}
        centres = {bend: _best_sizes(designs[bend], levels, centres.get(bend)) for bend in BENDS}
        solved = [_solve(centres[bend], designs[bend], levels) for bend in BENDS]
        mean = min(solved, key=lambda solution: solution.value).mean[: nodes.size]
        curve = PchipInterpolator(np.log(nodes), rising(mean))
        levels, slope, shift = straightened(measured, curve)
    nodes = _place_nodes(levels)
    solutions: list[_Solution] = []
    sizes: list[Floats] = []
    for bend in BENDS:
        design = _design(levels, nodes, slope, bend)
        for size in _around(centres[bend], design, levels):
            solutions.append(_solve(size, design, levels, with_covariance=True))
            sizes.append(size)
    fit = _average(levels, nodes, solutions, np.array(sizes))
    covariance = fit.covariance + _shared_shift(levels, shift, nodes.size)
    return replace(fit, log_exposure=fit.log_exposure + middle, covariance=covariance)


def _shared_shift(levels: Levels, shift: Floats, nodes: int) -> Floats:
    """Covariance of the gains from what the noise law gets wrong alike in all runs of a setting."""
    variance = np.zeros(nodes + len(levels.gains))
    for setting in range(len(levels.gains)):
        here = levels.setting == setting
        if setting != levels.reference and here.any():
            variance[nodes + setting] = float(SHIFT_ERROR * shift[here].mean()) ** 2
    return np.diag(variance)


def _place_nodes(levels: Levels) -> Floats:
    low, high = float(levels.counts.min()), float(levels.counts.max())
    half = NODES // 2
    both = np.concatenate([np.geomspace(low, high, half), np.linspace(low, high, half)])
    both.sort()
    keep = np.concatenate([[True], np.diff(np.log(both)) > 0.15 * np.log(high / low) / NODES])
    nodes = both[keep]
    nodes[-1] = high
    return np.asarray(nodes)


def _coordinate(counts: Floats, levels: Levels, bend: float) -> Floats:
    """Give the coordinate the response is smooth in: log y, with a share of the logit towards the top."""
    top = 1.02 * max(levels.saturation, float(levels.counts.max()))
    return np.asarray(np.log(counts) - bend * np.log1p(-counts / top))


def _design(levels: Levels, nodes: Floats, slope: Floats, bend: float) -> _Design:
    at = _coordinate(nodes, levels, bend)
    spline = CubicSpline(at, np.eye(nodes.size), bc_type="natural")
    basis = np.asarray(spline(_coordinate(levels.counts, levels, bend)))
    curvature = np.asarray(spline(at, 2))
    gap = np.diff(at)[:, None, None]
    left, right = curvature[:-1, :, None], curvature[1:, :, None]
    left_t, right_t = curvature[:-1, None, :], curvature[1:, None, :]
    pieces = gap / 6.0 * (2 * left * left_t + left * right_t + right * left_t + 2 * right * right_t)
    bending = pieces.sum(axis=0)
    eigenvalues = linalg.eigvalsh(bending)[2:]
    others = [index for index in range(len(levels.gains)) if index != levels.reference]
    chosen = levels.setting[:, None] == np.array(others, dtype=np.intp)[None, :]
    target = levels.log_energy[levels.level]
    known_gain = (
        np.full(len(levels.gains), np.nan) if levels.known_log_gain is None else levels.known_log_gain
    )
    stated = np.isfinite(known_gain[others])
    precision = np.where(stated, levels.known_stderr**-2.0, 0.0)
    return _Design(
        matrix=np.hstack([basis, -chosen.astype(np.float64)]),
        target=np.nan_to_num(target),
        noise=(slope * levels.counts_stderr / levels.counts) ** 2,
        level=levels.level,
        levels=levels.log_energy.size,
        known=np.isfinite(levels.log_energy),
        bending=bending,
        log_bending=float(np.log(np.maximum(eigenvalues, 1e-300)).sum()),
        gain_precision=precision,
        gain_pull=precision * np.nan_to_num(known_gain[others]),
    )


def _solve(size: Floats, design: _Design, levels: Levels, *, with_covariance: bool = False) -> _Solution:
    """Solve for given (log bending scale, log level error, log run error)."""
    bend, level_error, run_error = np.exp(size)
    diagonal = design.noise + run_error**2
    shared = np.where(design.known, level_error**2, UNKNOWN**2)
    inverse = 1.0 / diagonal
    weight = np.zeros(design.levels)
    np.add.at(weight, design.level, inverse)
    share = shared / (1.0 + shared * weight)
    weighted = design.matrix * inverse[:, None]
    level_matrix = np.zeros((design.levels, design.matrix.shape[1]))
    np.add.at(level_matrix, design.level, weighted)
    level_target = np.zeros(design.levels)
    np.add.at(level_target, design.level, design.target * inverse)
    normal = design.matrix.T @ weighted - level_matrix.T @ (share[:, None] * level_matrix)
    right = weighted.T @ design.target - level_matrix.T @ (share * level_target)
    count = design.bending.shape[0]
    normal[:count, :count] += design.bending / bend**2
    normal[range(count, len(normal)), range(count, len(normal))] += design.gain_precision
    right[count:] += design.gain_pull
    factor = linalg.cho_factor(normal + 1e-9 * np.eye(len(normal)), lower=True)
    mean = linalg.cho_solve(factor, right)
    energy = float(design.target**2 @ inverse - share @ level_target**2 - right @ mean)
    value = (
        energy
        + float(np.log(diagonal).sum() + np.log1p(shared * weight).sum())
        + 2.0 * (count - 2) * np.log(bend)
        - design.log_bending
        + 2.0 * float(np.log(np.diag(factor[0])).sum())
        + _weak_prior(size, levels)
    )
    covariance = linalg.cho_solve(factor, np.eye(len(normal))) if with_covariance else np.empty(0)
    return _Solution(value, mean, covariance)


def _weak_prior(size: Floats, levels: Levels) -> float:
    """Minus twice the log of the priors: wide, except for a level error that the user stated."""
    bend, level_error, run_error = size
    stated = levels.level_stderr
    centre, width = (np.log(0.005), 1.5) if not stated else (np.log(stated), 0.25)
    return float(
        ((bend - np.log(0.3)) / 2.0) ** 2
        + ((level_error - centre) / width) ** 2
        + ((run_error - np.log(0.002)) / 1.5) ** 2
    )


def _best_sizes(design: _Design, levels: Levels, start: Floats | None) -> Floats:
    """Find the most likely bending and error sizes, downhill from ``start`` or from a small grid."""
    if start is None:
        level_error = levels.level_stderr or 0.005
        grid = [np.log([bend, level_error, run]) for bend in (0.05, 0.5, 3.0) for run in (0.001, 0.01)]
        start = min(grid, key=lambda size: _solve(size, design, levels).value)
    found = optimize.minimize(
        lambda size: _solve(np.clip(size, -12.0, 5.0), design, levels).value,
        start,
        method="Nelder-Mead",
        options={"xatol": 0.05, "fatol": 0.05, "maxfev": 120},
    )
    return np.asarray(np.clip(found.x, -12.0, 5.0))


def _around(centre: Floats, design: _Design, levels: Levels) -> list[Floats]:
    """Points about the most likely sizes, spaced by how fast the likelihood falls off."""
    best = _solve(centre, design, levels).value
    steps = []
    for axis in range(3):
        shift = np.zeros(3)
        shift[axis] = 0.3
        rise = sum(_solve(centre + sign * shift, design, levels).value - best for sign in (-1.0, 1.0))
        steps.append(min(1.5, 0.3 * np.sqrt(2.0 / max(rise, 1e-3))))
    grid = np.array(np.meshgrid(*[[-1.3, 0.0, 1.3]] * 3)).reshape(3, -1).T
    return [np.clip(centre + offset * np.array(steps), -12.0, 5.0) for offset in grid]


def _average(levels: Levels, nodes: Floats, solutions: list[_Solution], sizes: Floats) -> JointFit:
    values = np.array([solution.value for solution in solutions])
    weights = np.exp(-0.5 * (values - values.min()))
    weights /= weights.sum()
    means = np.array([_with_reference(solution.mean, nodes.size, levels) for solution in solutions])
    mean = weights @ means
    away = means - mean
    covariance = (away * weights[:, None]).T @ away
    for weight, solution in zip(weights, solutions, strict=True):
        if weight > 1e-6:
            covariance += weight * _spread(solution.covariance, nodes.size, levels)
    log_exposure, note = _made_monotone(mean[: nodes.size])
    level_stderr, run_stderr = np.exp(weights @ sizes)[1:]
    curve = CubicSpline(np.log(nodes), mean[: nodes.size])
    log_gain = mean[nodes.size :]
    fitted = np.asarray(curve(np.log(levels.counts))) - log_gain[levels.setting]
    residual = levels.log_energy[levels.level] - fitted
    slope = np.asarray(curve(np.log(levels.counts), 1))
    noise = slope * levels.counts_stderr / levels.counts
    return JointFit(
        log_counts=np.log(nodes),
        log_exposure=log_exposure,
        log_gain=log_gain,
        covariance=covariance,
        residual=residual,
        counts=levels.counts,
        scatter=np.sqrt(noise**2 + level_stderr**2 + run_stderr**2),
        level_stderr=float(level_stderr),
        run_stderr=float(run_stderr),
        notes=note,
    )


def _with_reference(values: Floats, nodes: int, levels: Levels) -> Floats:
    return np.insert(values, nodes + levels.reference, 0.0)


def _spread(covariance: Floats, nodes: int, levels: Levels) -> Floats:
    at = nodes + levels.reference
    return np.insert(np.insert(covariance, at, 0.0, axis=0), at, 0.0, axis=1)


def _made_monotone(log_exposure: Floats) -> tuple[Floats, tuple[str, ...]]:
    """Guard: where noise bent the curve back, the nearest rising curve takes its place, and says so."""
    if np.all(np.diff(log_exposure) > 0.0):
        return log_exposure, ()
    return rising(log_exposure), ("the response had to be held monotone: levels are few or noisy there",)


def rising(values: Floats) -> Floats:
    """Give the nearest rising values (isotonic regression, ties broken by one part in a million)."""
    flat = np.asarray(optimize.isotonic_regression(values).x)
    return np.asarray(flat + 1e-6 * np.arange(values.size))
