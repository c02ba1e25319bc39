"""From measured frames and simulated pictures to a `Comparison`.

Everything relative is relative to a reference condition. A condition's energy is the sum over the
camera pixels that see the target and are good; the same pixels are summed in the simulation, so what
is missing is missing on both sides.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibration import Calibration
from imclab import similarity
from imclab.budget import DRAWN_INPUTS, OF_THE_MEASUREMENT, input_sources, sources_of
from imclab.comparison import Comparison, Outcome, Pair
from imclab.errors import Fault, InputError
from imclab.sighting import Seen, Sighting, dark_of, see
from imclab.uncertainty import ComparisonError, Estimate, budget, covariance, effective_dof

FloatArray = NDArray[np.float64]

PICTURE_BITS, STDERR_BITS = 24, 12


def assess(
    sightings: Sequence[Sighting],
    camera: Calibration,
    *,
    title: str,
    synthetic: bool,
    model: str,
    seed: int = 1,
) -> Comparison:
    """Compare all conditions of an experiment.

    Parameters
    ----------
    sightings : sequence of Sighting
        Each names its reference, which is among them.
    camera : calibration.Calibration
    model : str
        Motion between picture and camera, as `imclab.registration.register` takes it.
    seed : int
        Of the draws from the calibration's uncertainty.

    Raises
    ------
    InputError
        Names every condition whose frames do not show its target.
    """
    looked = [see(sighting, camera, model) for sighting in sightings]
    faults = [one for one in looked if isinstance(one, Fault)]
    if faults:
        raise InputError("registration", faults)
    seen = [one for one in looked if isinstance(one, Seen)]
    names = [sighting.name for sighting in sightings]
    reference = [names.index(sighting.reference) for sighting in sightings]
    sources = sources_of(seen, reference, camera, seed=seed)
    steps = input_sources(seen, reference)
    pairs = [_pair(one, seen[reference[i]], camera) for i, one in enumerate(seen)]
    outcomes = tuple(
        replace(
            _outcome(i, seen, pairs, reference[i], budget(sources, i), camera),
            input_steps=budget(steps, i),
            input_draws=len(seen[i].sighting.drawn_totals),
        )
        for i in range(len(seen))
    )
    return Comparison(
        title=title,
        synthetic=synthetic,
        outcomes=outcomes,
        covariance=covariance(sources),
        data_range=full_scale(camera),
    )


def _pair(seen: Seen, reference: Seen, camera: Calibration) -> Pair:
    one = seen.sighting
    through = Estimate(reference.scale, reference.scale * reference.frame_error)
    simulated = rounded(seen.simulated * through.value, PICTURE_BITS)
    dark = dark_of(camera, one.gain)
    return Pair(
        name=one.name,
        gain=one.gain,
        optical_depth=one.optical_depth,
        frames=len(one.counts),
        result=one.result.without_pictures(),
        registration=seen.registration,
        measured=rounded(seen.energy.mean(axis=0), PICTURE_BITS),
        measured_stderr=rounded(seen.stderr, STDERR_BITS),
        simulated=simulated,
        simulated_stderr=rounded(seen.simulated_stderr * through.value, STDERR_BITS),
        measured_counts=rounded(one.counts.mean(axis=0) - dark, PICTURE_BITS),
        simulated_counts=rounded(camera.counts(simulated, gain=one.gain) - dark, PICTURE_BITS),
        region=seen.region,
        throughput=through,
    )


def rounded(values: FloatArray, bits: int) -> FloatArray:
    """Return values with mantissas of so many bits: the zeros that follow take no room in a file."""
    mantissa, exponent = np.frexp(values)
    return np.asarray(np.ldexp(np.rint(mantissa * 2.0**bits), exponent - bits))


def _outcome(
    index: int,
    seen: Sequence[Seen],
    pairs: Sequence[Pair],
    reference: int,
    shares: Mapping[str, float],
    camera: Calibration,
) -> Outcome:
    own, other = seen[index], seen[reference]
    simulated = own.sighting.result.total / other.sighting.result.total
    measured = simulated * own.scale / other.scale
    of_measurement = {name: shares[name] for name in OF_THE_MEASUREMENT}
    of_simulation = {name: u for name, u in shares.items() if name not in OF_THE_MEASUREMENT}
    dof = {"frame to frame": min(own.frame_dof, other.frame_dof)}
    if own.sighting.drawn_totals:
        dof[DRAWN_INPUTS] = len(own.sighting.drawn_totals) - 1
    return Outcome(
        pair=pairs[index],
        reference=other.sighting.name,
        measured_ratio=Estimate(
            measured, measured * math.hypot(*of_measurement.values()), effective_dof(of_measurement, dof)
        ),
        simulated_ratio=Estimate(
            simulated, simulated * math.hypot(*of_simulation.values()), effective_dof(of_simulation, dof)
        ),
        error=ComparisonError(
            value=simulated / measured - 1.0, budget=shares, dof=effective_dof(shares, dof)
        ),
        metrics=_agreement(own, pairs[index], camera),
        degradation=_degradation(own, other, pairs[index], pairs[reference], camera),
        noisy_degradation=_noisy_degradation(own, other, pairs[index], pairs[reference], camera),
    )


def _agreement(seen: Seen, pair: Pair, camera: Calibration) -> dict[str, Estimate]:
    """Metrics of the simulated picture against the measured frames."""
    measured = _frames_above_dark(seen, camera)
    scores = _scores(((pair.simulated_counts, frame) for frame in measured), pair.region, camera)
    if len(measured) > 1:
        return similarity.mean_of(scores)
    drawn = _frames_from_noise(seen, pair, camera)
    return similarity.single(
        scores, _scores(((pair.simulated_counts, frame) for frame in drawn), pair.region, camera)
    )


def _degradation(
    own: Seen, other: Seen, pair: Pair, reference: Pair, camera: Calibration
) -> dict[str, tuple[Estimate, Estimate]]:
    """Metrics of this condition against its reference, in the simulation and in the measurement."""
    if own is other:
        return {}
    region = pair.region & reference.region
    simulated = [(reference.simulated_counts, pair.simulated_counts)]
    rng = np.random.default_rng(0)
    noisy = [
        (
            _with_monte_carlo_noise(reference, camera, rng),
            _with_monte_carlo_noise(pair, camera, rng),
        )
        for _ in range(similarity.NOISE_DRAWS)
    ]
    of_simulation = similarity.single(_scores(simulated, region, camera), _scores(noisy, region, camera))
    measured = list(zip(_frames_above_dark(other, camera), _frames_above_dark(own, camera), strict=False))
    scores = _scores(measured, region, camera)
    if len(measured) > 1:
        of_measurement = similarity.mean_of(scores)
    else:
        drawn = zip(
            _frames_from_noise(other, reference, camera, seed=1),
            _frames_from_noise(own, pair, camera),
            strict=True,
        )
        of_measurement = similarity.single(scores, _scores(drawn, region, camera))
    return {name: (of_simulation[name], of_measurement[name]) for name in scores}


def _scores(
    pairs: Iterable[tuple[FloatArray, FloatArray]], region: NDArray[np.bool_], camera: Calibration
) -> dict[str, FloatArray]:
    return similarity.score(pairs, region=region, data_range=full_scale(camera))


def _frames_above_dark(seen: Seen, camera: Calibration) -> FloatArray:
    return np.asarray(seen.sighting.counts - dark_of(camera, seen.sighting.gain))


def _noisy_degradation(
    own: Seen, other: Seen, pair: Pair, reference: Pair, camera: Calibration
) -> dict[str, Estimate]:
    """Metrics of the simulation against its reference, both with the camera's noise of one frame."""
    if own is other:
        return {}
    pictures = [
        _with_camera_noise(one, _frames_from_noise(seen, one, camera, seed=seed))
        for seed, (seen, one) in enumerate(((other, reference), (own, pair)), start=1)
    ]
    return similarity.mean_of(_scores(zip(*pictures, strict=True), pair.region & reference.region, camera))


def _with_camera_noise(pair: Pair, drawn: Sequence[FloatArray]) -> list[FloatArray]:
    """Add what frames of noise scatter about their mean: drawing spreads light once more than it should."""
    mean, few = np.mean(drawn, axis=0), math.sqrt(len(drawn) / (len(drawn) - 1))
    return [pair.simulated_counts + few * (frame - mean) for frame in drawn]


def _frames_from_noise(seen: Seen, pair: Pair, camera: Calibration, *, seed: int = 0) -> list[FloatArray]:
    rng = np.random.default_rng(seed)
    dark = dark_of(camera, pair.gain)
    return [
        camera.draw(pair.simulated, gain=pair.gain, rng=rng) - dark for _ in range(similarity.NOISE_DRAWS)
    ]


def _with_monte_carlo_noise(pair: Pair, camera: Calibration, rng: np.random.Generator) -> FloatArray:
    noise = rng.standard_normal(pair.simulated.shape) * pair.simulated_stderr
    energy = np.maximum(pair.simulated + noise, 0.0)
    return np.asarray(camera.counts(energy, gain=pair.gain) - dark_of(camera, pair.gain))


def full_scale(camera: Calibration) -> float:
    """Largest count of the camera: the data range L of every metric."""
    return float(2**camera.bit_depth - 1)
