"""From an experiment file to a folder with the report: read, calibrate, simulate, compare, render.

What takes long is kept as soon as it is done and used again by the next run with the same inputs, so
a run that was stopped goes on where it stood.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import calibration
from imclab import provenance
from imclab.assessment import assess
from imclab.comparison import Comparison, Outcome
from imclab.errors import Fault, InputError, InterruptedRunError
from imclab.experiment import Experiment, load_experiment, read_frames
from imclab.report import Paths, load, render, save
from imclab.report.background import background
from imclab.report.simulations import Simulations
from imclab.report.store import Store, digest_of

Progress = Callable[[str], None]
CALIBRATION = "calibration.h5"


@dataclass(frozen=True, kw_only=True)
class Report:
    """What a run leaves: the comparison, and where its page and numbers are."""

    comparison: Comparison
    paths: Paths

    def summary(self) -> dict[str, Any]:
        """Return the verdict of every condition, as numbers."""
        return {
            "title": self.comparison.title,
            "synthetic": self.comparison.synthetic,
            "page": str(self.paths.page),
            "numbers": str(self.paths.numbers),
            "conditions": [_condition(outcome) for outcome in self.comparison.outcomes],
        }

    def words(self) -> str:
        """Return the same as a table for people."""
        head = "SYNTHETIC data. " if self.comparison.synthetic else ""
        lines = [f"{head}{self.comparison.title}", ""]
        lines.append(
            f"{'condition':<20} {'E = sim/exp - 1':>22}  {'SSIM':>6} {'MSSIM':>6} {'PSNR':>6}  verdict"
        )
        for outcome in self.comparison.outcomes:
            ssim, mssim, psnr = (outcome.metrics[name].value for name in ("ssim", "mssim", "psnr"))
            error = f"{outcome.error.value:+.2%} +- {outcome.error.u_val:.2%}"
            verdict = outcome.error.verdict
            if outcome.reference == outcome.pair.name:
                error, verdict = "(reference)", ""
            lines.append(
                f"{outcome.pair.name:<20} {error:>22}  {ssim:6.3f} {mssim:6.3f} {psnr:6.2f}  {verdict}"
            )
        return "\n".join([*lines, "", f"page     {self.paths.page}", f"numbers  {self.paths.numbers}"])


def _condition(outcome: Outcome) -> dict[str, Any]:
    return {
        "name": outcome.pair.name,
        "reference": outcome.reference,
        "measured_ratio": outcome.measured_ratio.value,
        "measured_ratio_stderr": outcome.measured_ratio.stderr,
        "simulated_ratio": outcome.simulated_ratio.value,
        "simulated_ratio_stderr": outcome.simulated_ratio.stderr,
        "relative_error": outcome.error.value,
        "u_val": outcome.error.u_val,
        "verdict": outcome.error.verdict,
        "registration_px": outcome.pair.registration.target_stderr_px,
        **{name: estimate.value for name, estimate in outcome.metrics.items()},
    }


def run_report(
    path: str | Path,
    folder: str | Path,
    *,
    rel_error: float | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Make the validation report of an experiment.

    Parameters
    ----------
    path : path
        The experiment file.
    folder : path
        Where the report goes: empty, not there yet, or left by an earlier run.
    rel_error : float, optional
        Of the simulated pictures' energy; the experiment's own when left out.
    threads : int, optional
        For the simulations; all processors when left out.
    progress : callable, optional
        Told in words what is being done and how far it is.

    Raises
    ------
    InputError, calibration.CalibrationError
        Everything that is wrong with the input is found before the first simulation starts.
    InterruptedRunError
        After an interrupt; the finished pictures are kept.
    """
    say = progress or (lambda text: None)
    experiment = load_experiment(path)
    if rel_error is not None:
        changed = experiment.simulation.model_copy(update={"rel_error": rel_error})
        experiment = experiment.with_simulation(changed)
    store = Store(Path(folder), experiment.title)
    say("calibration")
    camera = _camera(experiment, store)
    frames = _frames(experiment, camera)
    store.keep(CALIBRATION, _calibration_key(experiment), camera.save)
    sightings = []
    simulations = Simulations(experiment, store, threads=threads, say=say)
    for number, condition in enumerate(experiment.condition, start=1):
        label = f"{condition.name} ({number} of {len(experiment.condition)})"
        try:
            counts = frames[condition.name]
            sightings.append(simulations.sighting(condition, counts, label))
        except KeyboardInterrupt:
            done = f"{number - 1} of {len(experiment.condition)} pictures are kept in {store.folder}"
            raise InterruptedRunError(f"interrupted; {done}. Run the same command to go on.") from None
    say("registration and comparison")
    comparison = assess(
        sightings,
        camera,
        title=experiment.title,
        synthetic=experiment.synthetic,
        model=experiment.registration,
    )
    say("page")
    context = background(experiment, Path(path), camera, store.folder)
    save(comparison, context, store.folder)
    paths = render(comparison, store.folder, context=context)
    store.forget_unused()
    for picture in set((store.folder / "figures").iterdir()) - set(paths.figures):
        picture.unlink()  # of conditions that the experiment no longer has
    return Report(comparison=comparison, paths=paths)


def render_again(folder: str | Path) -> Report:
    """Make the page of a finished report again from its saved numbers.

    Raises
    ------
    InputError
        When the folder holds no saved comparison.
    """
    comparison, context = load(folder)
    return Report(comparison=comparison, paths=render(comparison, folder, context=context))


def _calibration_key(experiment: Experiment) -> str:
    source = experiment.folder / experiment.calibration
    files = [source] if source.is_file() else sorted(file for file in source.rglob("*") if file.is_file())
    return digest_of(*(f"{file.name} {provenance.digest(file)}" for file in files))


def _camera(experiment: Experiment, store: Store) -> calibration.Calibration:
    source = experiment.folder / experiment.calibration
    if source.is_file():
        camera = calibration.load(source)
    elif store.holds(CALIBRATION, _calibration_key(experiment)):
        camera = calibration.load(store.folder / CALIBRATION)
    else:
        camera = calibration.calibrate(source)
    faults = [
        Fault(
            f"condition {condition.name}.gain",
            f"{condition.gain:g}",
            f"a calibrated setting: {', '.join(f'{gain:g}' for gain in camera.gains)}",
        )
        for condition in experiment.condition
        if condition.gain not in camera.gains
    ]
    if faults:
        raise InputError(str(source), faults)
    return camera


def _frames(experiment: Experiment, camera: calibration.Calibration) -> dict[str, NDArray[np.uint16]]:
    """Read the frames of every condition; the faults of all of them come together."""
    frames: dict[str, NDArray[np.uint16]] = {}
    faults: list[Fault] = []
    for condition in experiment.condition:
        try:
            stack = read_frames(experiment.files_of(condition), bit_depth=camera.bit_depth)
        except InputError as error:
            faults += error.faults
            continue
        frames[condition.name] = stack
        if stack.shape[1:] != camera.shape:
            came, wanted = (f"{rows}x{columns}" for rows, columns in (stack.shape[1:], camera.shape))
            where = f"condition {condition.name}.frames"
            faults.append(Fault(where, came, f"{wanted} as in the calibration"))
    if faults:
        raise InputError("frames", faults)
    return frames
