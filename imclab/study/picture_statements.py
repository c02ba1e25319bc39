"""The paper's statements on its pictures: gating, MSSIM beside SSIM, roughness."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from imclab.study.conclusion import Statement
from imclab.study.curves import Point
from imclab.study.file import Study
from imclab.study.ratios import difference, ratio, shown
from imclab.study.shots import GAINS, Pair
from imclab.uncertainty import Estimate

SIGMAS = 3.0
"""Two numbers differ for sure when they are so many standard errors apart."""


def gating(pairs: list[Pair]) -> list[Statement]:
    """One statement a target and gain: through the gate, and light of the target alone, against no gate."""
    statements = []
    for open_ in pairs:
        target, found, _ = open_.curve.rpartition(", not gated")
        gated = [
            pair for pair in pairs if found and (pair.curve, pair.gain) == (f"{target}, gated", open_.gain)
        ]
        if not gated:
            continue
        rises = all(_rises(open_, pair, name) for pair in gated for name in ("ssim", "psnr_db"))
        numbers = "; ".join(
            f"{pair.light}: SSIM {shown(open_.metrics['ssim'])} to {shown(pair.metrics['ssim'])}, "
            f"PSNR {shown(open_.metrics['psnr_db'])} to {shown(pair.metrics['psnr_db'])} dB"
            for pair in gated
        )
        text = f"Gating raises SSIM and PSNR ({target}, {open_.gain})."
        statements.append(Statement(text, rises, f"{numbers}."))
    return statements


def _rises(open_: Pair, gated: Pair, name: str) -> bool:
    return _surely_positive(difference(gated.metrics[name], open_.metrics[name]))


def _surely_positive(estimate: Estimate) -> bool:
    return estimate.value > SIGMAS * estimate.stderr


def toward_the_experiment(study: Study) -> list[Statement]:
    """What the paper's own rows say of its sentence that gating comes nearer to the experiment."""
    statements = []
    rows = {(row.curve, row.source): row for row in study.printed}
    for target in dict.fromkeys(row.curve for row in study.printed):
        found = [rows.get((target, f"simulation, {light}")) for light in ("not gated", "gated")]
        aim = rows.get((target, "experiment"))
        if aim is None or found[0] is None or found[1] is None:
            continue
        open_, gated = found[0], found[1]
        nearer = [
            abs(getattr(gated, name) - getattr(aim, name)) < abs(getattr(open_, name) - getattr(aim, name))
            for name in ("ssim", "psnr_db")
        ]
        numbers = (
            f"SSIM {open_.ssim} to {gated.ssim}, experiment {aim.ssim}: {_nearer_or_not(nearer[0])}; "
            f"PSNR {open_.psnr_db} to {gated.psnr_db} dB, experiment {aim.psnr_db} dB: "
            f"{_nearer_or_not(nearer[1])}."
        )
        text = f"By the paper's own table gating brings SSIM and PSNR nearer to the experiment's ({target})."
        statements.append(Statement(text, all(nearer), numbers))
    return statements


def _nearer_or_not(nearer: bool) -> str:
    return "nearer" if nearer else "farther"


def mssim_above_ssim(study: Study, pairs: list[Pair]) -> list[Statement]:
    """At each gain, for the value that the paper compares: MSSIM above SSIM, and by how much."""
    printed = [row.mssim - row.ssim for row in study.printed]
    statements = []
    for gain in GAINS:
        alike = [pair.metrics for pair in pairs if pair.gain == gain and pair.value == pairs[0].value]
        gaps = [difference(found["mssim"], found["ssim"]) for found in alike]
        values = [gap.value for gap in gaps]
        luminance = [found["luminance_mssim"].value for found in alike]
        statements.append(
            Statement(
                f"MSSIM lies above SSIM ({gain}).",
                all(_surely_positive(gap) for gap in gaps),
                f"MSSIM of eq. 16 less SSIM of eq. 15: {min(values):.3f} to {max(values):.3f}; in the paper "
                f"{min(printed):.3f} to {max(printed):.3f}. The map of local means alone gives "
                f"{min(luminance):.3f} to {max(luminance):.3f}, the paper's MSSIM is "
                f"{min(row.mssim for row in study.printed)} to {max(row.mssim for row in study.printed)}.",
            )
        )
    return statements


def roughness(name: str, points: list[Point]) -> list[Statement]:
    """From each roughness to the next: mean energy of the figure's pixels, and contrast to the ground."""
    ordered = sorted(points, key=lambda point: float(point.value))
    statements = []
    for smooth, rough in pairwise(ordered):
        before, after = _seen(smooth), _seen(rough)
        falls = all(_surely_positive(difference(one, two)) for one, two in zip(before, after, strict=True))
        numbers = (
            f"Figure {_joules(before[0])} to {_joules(after[0])} a pixel, "
            f"contrast {shown(before[1])} to {shown(after[1])}."
        )
        steps = f"from {smooth.value} to {rough.value}"
        text = f"Roughness lowers brightness and contrast, {steps} ({name})."
        statements.append(Statement(text, falls, numbers))
    return statements


def _joules(energy: Estimate) -> str:
    return f"({1e12 * energy.value:.3f} ± {1e12 * energy.stderr:.3f}) pJ"


def _seen(point: Point) -> tuple[Estimate, Estimate]:
    """Return the figure's mean energy and (figure - ground) / (figure + ground)."""
    figure = figure_pixels(point)
    bright, dark = _mean_over(point, figure), _mean_over(point, ~figure)
    over = ratio(dark, bright)
    contrast = (1.0 - over.value) / (1.0 + over.value)
    return bright, Estimate(contrast, 2.0 * over.stderr / (1.0 + over.value) ** 2)


def _mean_over(point: Point, pixels: NDArray[np.bool_]) -> Estimate:
    """Mean of some pixels; its error as if they were independent, and with what they share in full."""
    value = float(point.result.energy[pixels].mean())
    alone = float(np.sqrt((point.result.energy_stderr[pixels] ** 2).sum())) / pixels.sum()
    return Estimate(value, math.hypot(alone, value * point.result.relative_error))


def figure_pixels(point: Point) -> NDArray[np.bool_]:
    """Which pixels have their centre in the figure."""
    mask = point.scene.figure_mask
    rows, columns = point.result.energy.shape
    row = ((np.arange(rows) + 0.5) * mask.shape[0] / rows).astype(int)
    column = ((np.arange(columns) + 0.5) * mask.shape[1] / columns).astype(int)
    return np.asarray(mask[np.ix_(row, column)])
