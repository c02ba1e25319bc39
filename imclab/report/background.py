"""What the page says beside the comparison: the calibration, the gates, where every number comes from."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

import calibration
from imclab import provenance
from imclab.experiment import Experiment
from imclab.report.context import Context, Curve, Entry
from imclab.scene import Scene
from imclab.transport.setup import setup_of

MODELLED = (
    "A pulsed Gaussian beam with its divergence, spot and pulse shape (eqs. 1, 2).",
    "Absorption and multiple scattering in the water with the scene's phase function (eqs. 3-7).",
    "Reflection by figure and ground of the target with their own materials (eqs. 8-13).",
    "Gathering by the receiver's aperture where it stands, focused on the target (eq. 14).",
    "The gate as an expectation over the pulse; target light and backscatter tallied apart.",
    "Counts by the measured response, gain, dark level and sensitivity of each pixel.",
)


def background(experiment: Experiment, path: Path, camera: calibration.Calibration, folder: Path) -> Context:
    """Gather the page's context of an experiment read from ``path`` and reported in ``folder``."""
    files = {path.name: path}
    for condition in experiment.condition:
        for file in experiment.files_of(condition):
            files[file.relative_to(experiment.folder).as_posix()] = file
    provenance_entries = [
        *(Entry(f"version of {name}", version) for name, version in provenance.versions().items()),
        Entry("seed", experiment.simulation.seed),
        Entry("wanted relative error", experiment.simulation.rel_error),
        *(Entry(f"SHA-256 of {name}", provenance.digest(file)) for name, file in files.items()),
    ]
    return Context(
        calibration=tuple(
            Entry(
                figure.name,
                figure.value,
                figure.unit,
                math.hypot(figure.stderr, figure.systematic),
                setting=f"{figure.setting:g}" if math.isfinite(figure.setting) else "",
            )
            for figure in camera.figures
        ),
        response=_response_curve(camera),
        gain=_gain_curve(camera),
        gates={
            condition.name: gate
            for condition in experiment.condition
            if (gate := _gate(experiment.scene_of(condition))) is not None
        },
        modelled=MODELLED,
        provenance=tuple(provenance_entries),
        commands=(f"imclab report {path.name} -o {folder.name}",),
    )


def _gate(scene: Scene) -> tuple[float, float] | None:
    gate = setup_of(scene).gate
    return (gate.opens, gate.closes) if math.isfinite(gate.opens) else None


def _response_curve(camera: calibration.Calibration) -> Curve:
    counts, energy, relative = camera.lookup_table(camera.reference_gain)
    unit = "J per pixel" if camera.unit == "J" else "relative energy"
    return Curve(energy, counts, counts * relative, unit, "counts")


def _gain_curve(camera: calibration.Calibration) -> Curve:
    values = np.array([camera.relative_gain(gain) for gain in camera.gains])
    settings = np.array(camera.gains)
    return Curve(settings, values[:, 0], values[:, 1], "gain setting", "relative gain")
