"""Which pictures a report simulates, and that none is simulated twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imclab import transport
from imclab.errors import InputError
from imclab.experiment import Experiment, load_experiment
from imclab.report.simulations import Simulations
from imclab.report.store import Store
from imclab.sighting import Sighting
from tests.pictures import picture_of

TANK = Path(__file__).parents[3] / "data/experiments/tank/experiment.toml"
COUNTS = np.zeros((1, 2, 2), dtype=np.uint16)
SPREAD, DRAWS = 0.02, 10


def uncertain(**spreads: str | float) -> Experiment:
    experiment = load_experiment(TANK)
    simulation = experiment.simulation.model_copy(update={"input_draws": DRAWS})
    spreads = {key.replace("__", "."): spread for key, spread in spreads.items()}
    changes = {"uncertainty": spreads, "simulation": simulation, "condition": experiment.condition[:2]}
    return experiment.model_copy(update=changes)


def sightings(experiment: Experiment, folder: Path) -> list[Sighting]:
    made = Simulations(experiment, Store(folder, "rig"), threads=1, say=lambda text: None)
    return [made.sighting(condition, COUNTS, "") for condition in experiment.condition]


def test_steps_and_draws_follow_beers_law(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "simulate", lambda scene, **_: picture_of(scene, relative_noise=0.0))
    experiment = uncertain(medium__attenuation=f"{SPREAD} 1/m", target__distance="1 mm")
    first, second = sightings(experiment, tmp_path)
    effect, common = first.input_effects["medium.attenuation"]
    assert effect == pytest.approx(np.exp(-2 * SPREAD) - 1)
    assert not common  # each condition has its own attenuation
    assert first.input_effects["target.distance"][1]
    logs = np.log([first.drawn_totals, second.drawn_totals])
    assert logs.std(axis=1, ddof=1) == pytest.approx(2 * SPREAD, rel=0.05)
    assert abs(np.corrcoef(logs)[0, 1]) < 0.9  # it is 1 when the error is one for all, as below


def test_an_error_that_all_share_moves_all_in_each_draw(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "simulate", lambda scene, **_: picture_of(scene, relative_noise=0.0))
    first, second = sightings(uncertain(target__distance="5 mm"), tmp_path)
    depths = np.log(second.drawn_totals) / np.log(first.drawn_totals)
    assert depths == pytest.approx(0.92 / 0.42)


def test_what_is_kept_is_not_simulated_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []

    def simulate(scene: Any, **_: Any) -> Any:
        if len(calls) == 5:
            raise KeyboardInterrupt
        calls.append(scene.toml)
        return picture_of(scene, relative_noise=0.0)

    monkeypatch.setattr(transport, "simulate", simulate)
    experiment = uncertain(target__distance="1 mm")
    with pytest.raises(KeyboardInterrupt):
        sightings(experiment, tmp_path)
    done = list(calls)
    calls[:] = [""] * 6  # past the interrupt
    found = sightings(experiment, tmp_path)
    assert len(done) == 5
    assert len(calls) - 6 == 2 * (2 + DRAWS) - 5
    assert not set(calls[6:]) & set(done)
    calls.clear()
    assert [one.drawn_totals for one in sightings(experiment, tmp_path)] == [
        one.drawn_totals for one in found
    ]
    assert calls == []


def test_a_draw_that_makes_no_scene_is_told_before_anything_is_simulated(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="albedo"):
        Simulations(uncertain(medium__albedo=0.3), Store(tmp_path, "rig"), threads=1, say=lambda text: None)
