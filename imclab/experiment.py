"""An experiment: measured frames under several conditions, the scene they belong to, the calibration.

The file `experiment.toml` names them; `docs/experiment.md` shows one. Frames are read here and
nowhere else.
"""

from __future__ import annotations

import copy
import os
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, model_validator

from imclab.errors import Fault, InputError
from imclab.scene import Scene, load_scene
from imclab.schema import Part, read_toml, validate

FEWEST_DRAWS = 10
"""Below this many drawn scenes their spread says little."""


class Condition(Part):
    """One setting of the rig and the frames taken there."""

    name: Annotated[str, Field(min_length=1, pattern=r"^[\w .+-]+$")]
    frames: Annotated[tuple[str, ...], Field(min_length=1)]
    gain: float
    reference: str | None = None
    scene: dict[str, Any] = Field(default_factory=dict)

    @property
    def scene_changes(self) -> dict[str, Any]:
        """What of the scene this condition changes, as dotted paths."""
        return _flat(self.scene)


class Simulation(Part):
    """How well each condition is simulated.

    ``input_draws`` scenes are drawn within the experiment's ``uncertainty`` and simulated, for its
    propagation by Monte Carlo; with none it is propagated by one step of each input.
    """

    rel_error: Annotated[float, Field(gt=0, lt=1)] = 0.01
    seed: Annotated[int, Field(ge=0)] = 1
    estimator: Literal["auto", "analog", "expected", "two-sided"] = "auto"
    input_draws: Annotated[int, Field(ge=0)] = 0


class Experiment(Part):
    """What `experiment.toml` says. Make it with `load_experiment`.

    ``uncertainty`` gives the standard uncertainty of scene keys, as text with units or bare
    numbers, under the same dotted paths as ``scene`` of a condition.
    """

    schema_version: Annotated[Literal[1], Field(alias="schema")]
    title: str = ""
    synthetic: bool = False
    scene: str
    calibration: str
    reference: str
    registration: Literal["auto", "similarity", "affine", "homography"] = "similarity"
    simulation: Simulation = Simulation()
    uncertainty: dict[str, str | float] = Field(default_factory=dict)
    condition: Annotated[tuple[Condition, ...], Field(min_length=1)]

    _folder: Path = PrivateAttr(default=Path())
    _scenes: dict[str, Scene] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _names_exist(self) -> Self:
        names = [condition.name for condition in self.condition]
        if len(set(names)) != len(names):
            raise ValueError("wanted a different name for each condition")
        for reference in {self.reference, *(c.reference for c in self.condition if c.reference)}:
            if reference not in names:
                raise ValueError(f'wanted reference to be a condition: "{reference}" is none of {names}')
        if 0 < self.simulation.input_draws < FEWEST_DRAWS:
            raise ValueError(f"wanted simulation.input_draws to be 0 or at least {FEWEST_DRAWS}")
        if self.simulation.input_draws and not self.uncertainty:
            raise ValueError("wanted an [uncertainty] to draw from, or no simulation.input_draws")
        return self

    def with_simulation(self, simulation: Simulation) -> Experiment:
        """Return the same experiment, simulated in another way."""
        return self.model_copy(update={"simulation": simulation})

    @property
    def folder(self) -> Path:
        """Folder of the experiment file."""
        return self._folder

    def scene_of(self, condition: Condition) -> Scene:
        """Return the scene of one condition: the base scene with its changes."""
        return self._scenes[condition.name]

    def reference_of(self, condition: Condition) -> Condition:
        """Return the condition that ``condition`` is compared with."""
        name = condition.reference or self.reference
        return next(other for other in self.condition if other.name == name)

    def files_of(self, condition: Condition) -> tuple[Path, ...]:
        """Return the frame files of one condition, patterns expanded, in order."""
        found: list[Path] = []
        for pattern in condition.frames:
            found += sorted(self._folder.glob(pattern))
        return tuple(found)


def load_experiment(path: str | Path) -> Experiment:
    """Read and check an experiment file, its scenes and the presence of its frames.

    Raises
    ------
    InputError
        All faults together: keys, missing frames, scene changes that make no scene.
    """
    path = Path(path)
    document = read_toml(path, "an experiment file")
    experiment = validate(Experiment, document, str(path))
    experiment._folder = path.parent
    base = load_scene(path.parent / experiment.scene)
    faults: list[Fault] = []
    for index, condition in enumerate(experiment.condition):
        where = f"condition[{index}] {condition.name}"
        try:
            changes = _from_folder(condition.scene_changes, path.parent, base.folder)
            experiment._scenes[condition.name] = base.with_(**changes)
        except InputError as error:
            faults += [Fault(f"{where}.scene.{f.where}", f.came, f.wanted, f.advice) for f in error.faults]
        for pattern in condition.frames:
            if not any(path.parent.glob(pattern)):
                wanted = "a file or pattern of files beside the experiment file"
                faults.append(Fault(f"{where}.frames", f'"{pattern}", which matches no file', wanted))
    if not (path.parent / experiment.calibration).exists():
        wanted = "a calibration folder or a file made by `imclab calibrate`"
        faults.append(Fault("calibration", f'"{experiment.calibration}", which does not exist', wanted))
    if faults:
        raise InputError(str(path), faults)
    return experiment


def _from_folder(changes: dict[str, Any], folder: Path, scene_folder: Path) -> dict[str, Any]:
    """Let file names in scene changes be relative to the experiment file, as every name in it is."""
    changes = copy.deepcopy(changes)
    mask = changes.get("target.mask")
    if isinstance(mask, str):
        changes["target.mask"] = Path(os.path.relpath(folder / mask, scene_folder)).as_posix()
    return changes


def _flat(table: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def read_frames(files: tuple[Path, ...], *, bit_depth: int) -> NDArray[np.uint16]:
    """Read frames and stacks of one condition.

    Parameters
    ----------
    files : tuple of path
        TIFF or PNG; a file may hold a stack.
    bit_depth : int
        Of the camera; a frame with larger values is refused.

    Returns
    -------
    array (frames, rows, columns) of uint16

    Raises
    ------
    InputError
        Unreadable files, different sizes, wrong kind, all dark or all saturated: all together.
    """
    stacks: list[NDArray[np.uint16]] = []
    faults: list[Fault] = []
    for file in files:
        try:
            stack = _read(file)
        except (OSError, ValueError) as error:
            faults.append(Fault(str(file), str(error), "a TIFF or PNG of one channel"))
            continue
        full = 2**bit_depth - 1
        if stack.max() > full:
            wanted = f"at most {full} ({bit_depth} bit)"
            faults.append(Fault(str(file), f"counts up to {stack.max()}", wanted, "Is the bit depth right?"))
        elif stack.min() == stack.max():
            came = "all pixels " + ("saturated" if stack.max() == full else f"{stack.max()}")
            faults.append(Fault(str(file), came, "a picture"))
        elif np.median(stack) == full:
            faults.append(Fault(str(file), "more than half of the pixels saturated", "a picture"))
        stacks.append(stack)
    shapes = sorted({stack.shape[1:] for stack in stacks})
    if len(shapes) > 1:
        sizes = ", ".join(f"{rows}x{columns}" for rows, columns in shapes)
        faults.append(Fault("frames", f"sizes {sizes}", "one size"))
    if faults:
        raise InputError("frames", faults)
    return np.concatenate(stacks)


def _read(file: Path) -> NDArray[np.uint16]:
    if file.suffix.lower() in (".tif", ".tiff"):
        import tifffile

        stack = tifffile.imread(file)
    else:
        from skimage.io import imread

        stack = imread(file)
    stack = np.asarray(stack)
    if stack.ndim == 2:
        stack = stack[np.newaxis]
    if stack.ndim != 3 or stack.dtype.kind not in "u" or stack.dtype.itemsize > 2:
        raise ValueError(f"shape {stack.shape} of {stack.dtype}")
    return stack.astype(np.uint16)
