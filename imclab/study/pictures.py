"""Pictures and their quality: gated and not, clear and turbid, smooth and rough (Figs. 4, 6, 7; Tables 1, 2).

The energies become counts through the detector of the study file. Its gain is the paper's unprinted
choice; ours is stated: the reference picture's 99.9th percentile comes to lie at `BRIGHTEST` of full
scale, and the compared picture is taken at the same gain. ``own gain`` beside it raises the compared
picture to the same brightness, as the experiment did.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imclab import metrics
from imclab.detector import IntensifiedCamera
from imclab.result import Flux, Result
from imclab.scene import Detector
from imclab.study.conclusion import Conclusion, Row, Statement
from imclab.study.curves import Point, curves_of
from imclab.study.file import Study
from imclab.study.ratios import shown
from imclab.uncertainty import Estimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
Metric = Callable[..., float]

BRIGHTEST = 0.8
PERCENTILE = 99.9
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


def conclude(study: Study, records: Sequence[Result | Flux]) -> Conclusion:
    """Return table, figure and statements of pictures compared with the first of their curve.

    Curves named ``TARGET, gated`` and ``TARGET, not gated`` are compared with one another; when the
    roughness varies, brightness and contrast are looked at.
    """
    curves = curves_of(study, records)
    pairs = [pair for name, points in curves.items() for pair in _pairs(study.detector, name, points)]
    statements = [*_gating(pairs), _mssim_above_ssim(pairs)]
    if study.vary is not None and study.vary.key == "target.figure.roughness":
        statements += [_roughness(name, points) for name, points in curves.items()]
    return Conclusion(
        title=study.title,
        shows=study.shows,
        rows=[*(_row(pair) for pair in pairs), *_printed(study)],
        statements=statements,
        largest_relative_error=max(p.result.relative_error for points in curves.values() for p in points),
        cpu_seconds=sum(record.cpu_seconds for record in records),
        figure=_figure(study, curves),
    )


def _pairs(detector: Detector, name: str, points: list[Point]) -> list[Pair]:
    lights = {"through the gate": "energy"}
    if name.endswith(", gated"):
        lights["target light alone"] = "target"
    pairs = []
    for light, part in lights.items():
        brightest = [_brightest(point, part) for point in points]
        reference = _shot(detector, points[0], part, brightest[0])
        for point, own in zip(points[1:], brightest[1:], strict=True):
            for gain, scale in (("same gain", brightest[0]), ("own gain", own)):
                shot = _shot(detector, point, part, scale)
                pairs.append(Pair(name, light, point.value, gain, _compared(reference, shot)))
    return pairs


def _brightest(point: Point, part: str) -> float:
    return float(np.percentile(getattr(point.result, part), PERCENTILE))


def _shot(detector: Detector, point: Point, part: str, brightest: float) -> Shot:
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


def _row(pair: Pair) -> Row:
    row: Row = {"curve": pair.curve, "source": f"ours: {pair.light}, {pair.gain}", "compared": pair.value}
    for name, estimate in pair.metrics.items():
        row |= {name: estimate.value, f"{name}_stderr": estimate.stderr}
    return row


def _printed(study: Study) -> list[Row]:
    rows = []
    for printed in study.printed:
        row: Row = {"curve": printed.curve, "source": f"paper: {printed.source}", "compared": ""}
        for name in METRICS:
            row |= {name: getattr(printed, name, ""), f"{name}_stderr": ""}
        rows.append(row)
    return rows


def _gating(pairs: list[Pair]) -> list[Statement]:
    """One statement a target: through the gate and as light of the target alone, against no gate."""
    statements = []
    same_gain = [pair for pair in pairs if pair.gain == "same gain"]
    for open_ in same_gain:
        target, found, _ = open_.curve.rpartition(", not gated")
        gated = [p for p in same_gain if found and p.curve == f"{target}, gated" and p.value == open_.value]
        if not gated:
            continue
        rises = all(
            pair.metrics[name].value - open_.metrics[name].value
            > 2 * np.hypot(pair.metrics[name].stderr, open_.metrics[name].stderr)
            for pair in gated
            for name in ("ssim", "psnr_db")
        )
        numbers = "; ".join(
            f"{pair.light}: SSIM {shown(open_.metrics['ssim'])} to {shown(pair.metrics['ssim'])}, "
            f"PSNR {shown(open_.metrics['psnr_db'])} to {shown(pair.metrics['psnr_db'])} dB"
            for pair in gated
        )
        statements.append(Statement(f"Gating raises SSIM and PSNR ({target}).", rises, f"{numbers}."))
    return statements


def _mssim_above_ssim(pairs: list[Pair]) -> Statement:
    same_gain = [pair for pair in pairs if pair.gain == "same gain"]
    gaps = [pair.metrics["mssim"].value - pair.metrics["ssim"].value for pair in same_gain]
    luminance = [pair.metrics["luminance_mssim"].value for pair in same_gain]
    return Statement(
        "MSSIM lies far above SSIM (by 0.3 and more).",
        min(gaps) > 0.3,
        f"MSSIM of eq. 16 less SSIM of eq. 15: {min(gaps):.3f} to {max(gaps):.3f}; the map of local means "
        f"alone gives {min(luminance):.4f} to {max(luminance):.4f}, the paper prints 0.998 and 0.999.",
    )


def _roughness(name: str, points: list[Point]) -> Statement:
    """Mean energy of the figure's pixels and its contrast to the ground, from smooth to rough."""
    looked = []
    for point in sorted(points, key=lambda point: float(point.value)):
        energy, figure = point.result.energy, _figure_pixels(point)
        bright, dark = float(energy[figure].mean()), float(energy[~figure].mean())
        looked.append((point.value, bright, (bright - dark) / (bright + dark)))
    falls = all(a[1] > b[1] and a[2] > b[2] for a, b in pairwise(looked))
    numbers = "; ".join(f"{value}: {bright:.3g} J, {contrast:.4f}" for value, bright, contrast in looked)
    return Statement(f"Roughness lowers brightness and contrast ({name}).", falls, f"{numbers}.")


def _figure_pixels(point: Point) -> NDArray[np.bool_]:
    """Which pixels have their centre in the figure."""
    mask = point.scene.figure_mask
    rows, columns = point.result.energy.shape
    row = ((np.arange(rows) + 0.5) * mask.shape[0] / rows).astype(int)
    column = ((np.arange(columns) + 0.5) * mask.shape[1] / columns).astype(int)
    return np.asarray(mask[np.ix_(row, column)])


def _figure(study: Study, curves: dict[str, list[Point]]) -> Figure:
    from matplotlib.figure import Figure

    columns = max(len(points) for points in curves.values())
    figure = Figure(figsize=(2.4 * columns + 0.6, 2.5 * len(curves)), layout="constrained")
    panels = figure.subplots(len(curves), columns, squeeze=False)
    label = "" if study.vary is None else study.vary.label
    for line, (name, points) in zip(panels, curves.items(), strict=True):
        scale = _brightest(points[0], "energy")
        for axes, point in zip(line, points, strict=False):
            shot = _shot(study.detector, point, "energy", scale)
            axes.imshow(shot.counts, cmap="gray", vmin=0, vmax=shot.full_scale)
            axes.set_title(f"{name}\n{label} {point.value}", fontsize="x-small")
            axes.set_axis_off()
    return figure
