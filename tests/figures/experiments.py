"""Coverage of the energy ratio's interval over many synthetic experiments, and the power to see an error.

``python -m tests.figures.experiments 100`` makes that many virtual rigs, each with its own camera,
misalignment, noise and calibration frames, and runs each through calibration, registration and
comparison. It prints how often the stated 95 % interval of the measured energy ratio holds the true
ratio, how often E is within twice its validation uncertainty when the simulation is right, and how
often a simulation whose attenuation is 5 % wrong is flagged.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from unittest import mock

import numpy as np

import calibration
import imclab
import imclab.twin
from imclab.assessment import assess
from imclab.comparison import Outcome
from imclab.experiment import Experiment, load_experiment, read_frames
from imclab.sighting import Sighting
from imclab.twin import TwinPlan, make_twin
from tests.pictures import picture_of

DATA = Path(__file__).parents[2] / "data"
DEPTHS = (0.42, 1.42)
SIMULATION_NOISE = 0.01  # relative, of each simulated pixel; the total's error follows


@dataclass(frozen=True)
class Trial:
    """What one synthetic experiment says of its own truth."""

    ratio_inside: bool
    agrees: bool
    flagged: bool
    deviation: float
    """Of the measured ratio from the true one, in stated standard uncertainties."""


def trial(seed: int) -> Trial:
    """Make one virtual rig, measure with it, and judge it by its truth."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "tank"
        plan = TwinPlan(
            optical_depths=DEPTHS,
            masks=(DATA / "targets/diver.png",),
            frames=6,
            frame_shape=(128, 128),
            seed=seed,
        )
        scene = imclab.load_scene(DATA / "scenes/tank.toml").with_(**{"receiver.pixels": [120, 120]})
        with mock.patch.object(imclab.twin, "simulate", partial(picture_of, relative_noise=0.0)):
            make_twin(scene, folder, plan)
        experiment = load_experiment(folder / "experiment.toml")
        camera = calibration.calibrate(folder / "calibration")
        right = _last(experiment, camera, seed, attenuation_error=0.0)
        wrong = _last(experiment, camera, seed, attenuation_error=0.05)
        true = float(np.exp(-2 * (DEPTHS[1] - DEPTHS[0])))
        low, high = right.measured_ratio.interval
        return Trial(
            ratio_inside=low <= true <= high,
            agrees=right.error.verdict.startswith("agrees"),
            flagged=not wrong.error.verdict.startswith("agrees"),
            deviation=(right.measured_ratio.value - true) / right.measured_ratio.stderr,
        )


def _last(
    experiment: Experiment, camera: calibration.Calibration, seed: int, *, attenuation_error: float
) -> Outcome:
    """Compare the last condition, its simulated attenuation wrong by a share."""
    sightings = []
    for index, condition in enumerate(experiment.condition):
        scene = experiment.scene_of(condition)
        attenuation = scene.medium.attenuation or 0.0
        wrong = scene.with_(**{"medium.attenuation": f"{attenuation * (1 + attenuation_error)} 1/m"})
        sightings.append(
            Sighting(
                name=condition.name,
                reference=experiment.reference_of(condition).name,
                gain=condition.gain,
                optical_depth=DEPTHS[index],
                counts=read_frames(experiment.files_of(condition), bit_depth=camera.bit_depth),
                result=picture_of(wrong, seed=1000 * seed + index, relative_noise=SIMULATION_NOISE),
                input_effects={},
            )
        )
    comparison = assess(sightings, camera, title="", synthetic=True, model="similarity", seed=seed)
    return comparison.outcomes[-1]


def trials(count: int) -> Iterator[Trial]:
    """Give ``count`` trials, each with its own seed."""
    for seed in range(1, count + 1):
        yield trial(seed)


def main() -> None:
    """Print the shares with their binomial standard errors."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    done = list(trials(count))
    for name, hits in (
        ("95 % interval of the measured ratio holds the truth", [t.ratio_inside for t in done]),
        ("right simulation agrees within its uncertainty", [t.agrees for t in done]),
        ("simulation with 5 % wrong attenuation is flagged", [t.flagged for t in done]),
    ):
        share = float(np.mean(hits))
        print(f"{name}: {share:.3f} +- {np.sqrt(share * (1 - share) / count):.3f} of {count}")
    off = np.array([t.deviation for t in done])
    print(f"deviation in stated uncertainties: mean {off.mean():+.2f}, spread {off.std(ddof=1):.2f}")


if __name__ == "__main__":
    main()
