"""A comparison of made-up data: two targets, three optical depths each, known errors.

Labelled synthetic like everything that was not measured. Nothing here is simulated: the pictures are
drawn, blurred and given noise, so that the page can be tested without the rest of the house.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from imclab.comparison import Comparison, Outcome, Pair
from imclab.registration import Registration
from imclab.registration.motion import Frame
from imclab.report.context import Context, Curve, Entry
from imclab.result import Result
from imclab.uncertainty import ComparisonError, Estimate, budget, covariance

DEPTHS = (0.42, 0.92, 1.42)
SOURCES = {"Monte Carlo": 0.008, "frame to frame": 0.006, "registration": 0.002}
COMMON = {"calibration": 0.02, "medium.attenuation": 0.03}
SCENE = """schema = 1
title = "made up"

[medium]
attenuation = "{depth} 1/m"
"""


def comparison(*, errors: tuple[float, ...] = (0.0, 0.03, -0.12), size: int = 96) -> Comparison:
    """Two targets at three depths; ``errors`` are the relative errors of each target's conditions."""
    names = [f"{target}-{depth:g}" for target in ("diver", "slit") for depth in DEPTHS]
    reference = [0, 0, 0, 3, 3, 3]
    sources = {name: _own(u, reference) for name, u in SOURCES.items()}
    for name, u in COMMON.items():
        depth = np.array(DEPTHS * 2) - DEPTHS[0]
        sources[name] = (u * depth / depth.max())[np.newaxis]
    pairs = [_pair(names[i], DEPTHS[i % 3], size, seed=i) for i in range(6)]
    outcomes = tuple(
        _outcome(pairs[i], names[reference[i]], errors[i % 3], budget(sources, i)) for i in range(6)
    )
    return Comparison(
        title="Made-up tank: diver and double slit",
        synthetic=True,
        outcomes=outcomes,
        covariance=covariance(sources),
        data_range=4095.0,
    )


def context() -> Context:
    """What a pipeline would tell beside the comparison."""
    level = np.geomspace(40.0, 3600.0, 16)
    energy = 2e-19 * level**1.08
    settings = np.arange(700.0, 801.0, 20.0)
    gain = (settings / 700.0) ** 18
    return Context(
        calibration=(
            Entry("dark level", 96.2, "counts", 0.1),
            Entry("read noise", 2.21, "counts", 0.04),
            Entry("excess noise factor", 1.58, "", 0.05),
            Entry("frames used", 228),
            Entry("bad pixels", 23),
            *(Entry("relative gain", (s / 700) ** 18, "", 0.01, setting=f"{s:g}") for s in (700.0, 740.0)),
        ),
        response=Curve(energy, level, 0.01 * level, "energy per pixel / J", "counts above dark"),
        gain=Curve(settings, gain, 0.01 * gain, "intensifier setting", "gain over the lowest setting"),
        gates={f"{target}-{depth:g}": (8.2e-9, 11.2e-9) for target in ("diver", "slit") for depth in DEPTHS},
        modelled=("Henyey-Greenstein scattering, albedo 0.89", "Microfacet figure on a Lambertian ground"),
        provenance=(
            Entry("imclab", "0.1.0"),
            Entry("numpy", "2.4.6"),
            Entry("experiment.toml", "sha256 9f2c4be1a6d0" + "0" * 52),
            Entry("seed", 1),
        ),
        commands=("imclab report experiment.toml -o report", "imclab report --from-saved report"),
    )


def _own(u: float, reference: list[int]) -> NDArray[np.float64]:
    effects = np.eye(len(reference)) * u
    for condition, source in enumerate(reference):
        effects[source, condition] -= u
    return effects


def drawing(name: str, size: int) -> NDArray[np.float64]:
    """Draw a figure of ones on zeros, turned by three degrees."""
    y, x = np.mgrid[:size, :size] / (size - 1.0) - 0.5
    turn = math.radians(3.0)
    u, v = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)
    if name.startswith("slit"):
        figure = (abs(abs(u) - 0.14) < 0.07) & (abs(v) < 0.36)
    else:
        body = (abs(u) < 0.12) & (abs(v) < 0.3)
        head = np.hypot(u, v + 0.36) < 0.08
        arms = (abs(v + 0.12) < 0.04) & (abs(u) < 0.34)
        figure = body | head | arms
    return figure.astype(float)


def _pair(name: str, depth: float, size: int, *, seed: int) -> Pair:
    rng = np.random.default_rng(seed)
    level = 4e-16 * math.exp(-2.0 * depth)
    clean = gaussian_filter(0.1 + 0.9 * drawing(name, size), 0.8) * level
    beam = np.exp(-(((np.mgrid[:size, :size] - size / 2) / size) ** 2).sum(axis=0))
    clean = clean * beam
    blurred = gaussian_filter(clean, 0.7)
    spread = np.sqrt(blurred * level) * 0.05
    measured = blurred + spread * rng.standard_normal(clean.shape)
    simulated = clean * (1 + 0.004 * rng.standard_normal(clean.shape))
    region = np.zeros(clean.shape, dtype=bool)
    region[3:-3, 3:-3] = True
    for row, column in ((size // 3, size // 2), (2 * size // 3, size // 4)):
        region[row, column] = False
        measured[row, column] = np.nan
    counts = 1800.0 / level
    return Pair(
        name=name,
        gain=700.0 + 40.0 * DEPTHS.index(depth),
        optical_depth=depth,
        frames=8,
        result=_result(clean, depth, seed),
        registration=_registration(size),
        measured=measured,
        measured_stderr=spread,
        simulated=simulated,
        simulated_stderr=0.004 * clean,
        measured_counts=measured * counts,
        simulated_counts=simulated * counts,
        region=region,
        throughput=Estimate(0.913, 0.011),
    )


def _result(energy: NDArray[np.float64], depth: float, seed: int) -> Result:
    edges = np.arange(0.0, 25.1e-9, 0.25e-9)
    middle = (edges[1:] + edges[:-1]) / 2
    shape = np.exp(-(((middle - 9.7e-9) / 1.9e-9) ** 2) / 2) + 0.15 * depth * np.exp(-middle / 6e-9)
    total = float(energy.sum())
    zeros = np.zeros_like(energy)
    return Result(
        energy=energy,
        energy_stderr=0.004 * energy,
        target=0.94 * energy,
        target_stderr=0.004 * energy,
        backscatter=0.06 * energy,
        backscatter_stderr=zeros,
        total=total,
        total_stderr=0.006 * total,
        target_total=0.94 * total,
        target_total_stderr=0.006 * total,
        backscatter_total=0.06 * total,
        backscatter_total_stderr=0.001 * total,
        scene=SCENE.format(depth=depth),
        estimator="expected",
        seed=seed,
        packets=2_400_000 + 10_000 * seed,
        cpu_seconds=3.21 + depth,
        wall_seconds=1.75 + depth,
        threads=2,
        time_edges=edges,
        time_energy=shape * total / shape.sum(),
        time_stderr=0.02 * shape * total / shape.sum(),
        notes=("no polarisation", "the tank has no side walls"),
        versions={"imclab": "0.1.0"},
    )


def _registration(size: int) -> Registration:
    turn, scale = math.radians(1.7), 0.83
    matrix = np.eye(3)
    matrix[:2, :2] = scale * np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    matrix[:2, 2] = 0.1 * size
    return Registration(
        matrix=matrix,
        model="similarity",
        ok=True,
        reason="",
        quality=0.97,
        contrast=140.0,
        covariance=np.diag([1e-3, 8e-4, 6e-4, 9e-4]) ** 2,
        stderr_px=0.071,
        corner_stderr_px=np.array([0.07, 0.06, 0.08, 0.07]),
        target_stderr_px=0.03,
        blur_px=0.9,
        fixed_shape=(size, size),
        moving_shape=(size, size),
        frame=Frame(size / 2, size / 2, size / 3),
    )


def _outcome(pair: Pair, reference: str, error: float, shares: dict[str, float]) -> Outcome:
    own = pair.name == reference
    measured = math.exp(-2.0 * (pair.optical_depth - DEPTHS[0]))
    of_measurement = math.hypot(shares["frame to frame"], shares["calibration"])
    of_simulation = math.hypot(shares["Monte Carlo"], shares["medium.attenuation"])
    error = 0.0 if own else error + (0.01 if pair.name.startswith("slit") else 0.0)
    simulated = measured * (1 + error)
    metrics = {
        "ssim": Estimate(0.943 - 0.05 * pair.optical_depth, 0.0011),
        "mssim": Estimate(0.871 - 0.06 * pair.optical_depth, 0.0008),
        "psnr": Estimate(29.3 - 2 * pair.optical_depth, 0.04),
        "luminance_mssim": Estimate(0.9991, 0.0001),
    }
    degradation = {
        name: (Estimate(value.value * 0.7, value.stderr), Estimate(value.value * 0.69, 2 * value.stderr))
        for name, value in metrics.items()
    }
    return Outcome(
        pair=pair,
        reference=reference,
        measured_ratio=Estimate(measured, measured * of_measurement),
        simulated_ratio=Estimate(simulated, simulated * of_simulation),
        error=ComparisonError(value=error, budget=shares),
        metrics=metrics,
        degradation={} if own else degradation,
        noisy_degradation={} if own else {name: both[1] for name, both in degradation.items()},
    )
