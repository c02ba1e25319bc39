"""The simulated pictures of an experiment: each kept as soon as it is done, made once."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imclab import transport
from imclab.experiment import Condition, Experiment
from imclab.files import written_whole
from imclab.inputs import joint_steps, moved_by_its_uncertainty, moved_together
from imclab.report.store import Store, digest_of
from imclab.result import Result
from imclab.scene import Scene
from imclab.sighting import Sighting
from imclab.transport.media import water_of


class Simulations:
    """Simulates what a report needs, and keeps it in the report's folder.

    Parameters
    ----------
    experiment : Experiment
    store : Store
        What it holds from the same inputs is not simulated again.
    threads : int or None
    say : callable
        Told in words what is being done and how far it is.

    Raises
    ------
    InputError
        When an input moved within its uncertainty makes no scene; before anything is simulated.
    """

    def __init__(
        self, experiment: Experiment, store: Store, *, threads: int | None, say: Callable[[str], None]
    ) -> None:
        self.experiment = experiment
        self._store, self._threads, self._say = store, threads, say
        spreads = dict(sorted(experiment.uncertainty.items()))
        self._common = {
            dotted: all(dotted not in each.scene_changes for each in experiment.condition)
            for dotted in spreads
        }
        steps = joint_steps(
            list(self._common.values()),
            conditions=len(experiment.condition),
            draws=experiment.simulation.input_draws,
            seed=experiment.simulation.seed,
        )
        scenes = {each.name: experiment.scene_of(each) for each in experiment.condition}
        self._moved = {
            name: {key: moved_by_its_uncertainty(scene, key, spread) for key, spread in spreads.items()}
            for name, scene in scenes.items()
        }
        self._drawn = {
            name: [moved_together(scene, spreads, step) for step in steps[:, index]]
            for index, (name, scene) in enumerate(scenes.items())
        }

    def sighting(self, condition: Condition, counts: NDArray[np.uint16], label: str) -> Sighting:
        """Return the simulated picture of one condition beside its frames, and what its inputs do to it.

        Raises
        ------
        KeyboardInterrupt
            Also when the simulation was stopped and left a picture unfinished.
        """
        scene = self.experiment.scene_of(condition)
        result = self._picture(condition.name, scene, label)
        effects = {}
        for index, (dotted, moved) in enumerate(self._moved[condition.name].items(), start=1):
            other = self._total(f"{condition.name}-input{index}", moved, result, f"{label}, {dotted} moved")
            effects[dotted] = (other / result.total - 1.0, self._common[dotted])
        drawn = self._drawn[condition.name]
        totals = [
            self._total(
                f"{condition.name}-draw{index:03d}", moved, result, f"{label}, draw {index} of {len(drawn)}"
            )
            for index, moved in enumerate(drawn, start=1)
        ]
        return Sighting(
            name=condition.name,
            reference=self.experiment.reference_of(condition).name,
            gain=condition.gain,
            optical_depth=water_of(scene)[0].attenuation * scene.target.distance,
            counts=counts,
            result=result,
            input_effects=effects,
            drawn_totals=tuple(total / result.total for total in totals),
        )

    def _key(self, scene: Scene, **until: float) -> str:
        how = self.experiment.simulation
        mask = hashlib.sha256(np.packbits(scene.figure_mask).tobytes()).hexdigest()
        return digest_of(scene.toml, mask, how.estimator, str(how.seed), json.dumps(until, sort_keys=True))

    def _picture(self, name: str, scene: Scene, label: str) -> Result:
        until = {"rel_error": self.experiment.simulation.rel_error}
        file, key = self._store.folder / f"{name}.h5", self._key(scene, **until)
        if self._store.holds(file.name, key):
            return Result.load(file)
        result = self._simulated(scene, label, **until)
        self._store.keep(file.name, key, result.save)
        return result

    def _total(self, name: str, scene: Scene, like: Result, label: str) -> float:
        """Return the energy of a scene near another's, J, by the same histories as ``like``.

        What both share cancels in the difference; the number alone is kept.
        """
        file, key = self._store.folder / f"{name}.json", self._key(scene, packets=like.packets)
        if self._store.holds(file.name, key):
            return float(json.loads(file.read_text(encoding="utf-8"))["total"])
        total = self._simulated(scene, label, packets=like.packets).total

        def save(path: Path) -> None:
            with written_whole(path) as temporary:
                temporary.write_text(json.dumps({"total": total, "unit": "J"}) + "\n", encoding="utf-8")

        self._store.keep(file.name, key, save)
        return total

    def _simulated(self, scene: Scene, label: str, **until: Any) -> Result:
        how = self.experiment.simulation
        self._say(f"simulating {label}")
        result = transport.simulate(
            scene,
            seed=how.seed,
            estimator=how.estimator,
            threads=self._threads,
            progress=lambda at: self._say(
                f"simulating {label}: {_error(at.rel_error)} after {at.seconds:.1f} s"
            ),
            **until,
        )
        if result.interrupted:
            raise KeyboardInterrupt
        return result


def _error(relative: float) -> str:
    return f"{relative:.2%}" if math.isfinite(relative) else "error not known yet"
