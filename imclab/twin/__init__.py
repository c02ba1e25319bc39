"""A virtual rig: a synthetic experiment and calibration folder, with the truth kept beside them.

Everything it writes is labelled synthetic. It goes the way of the light (scene -> energy ->
misaligned camera -> frames) with `imclab.detector` and its own geometry, and shares no code with the
calibration, the registration or the comparison that it is there to test.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imclab.errors import Fault, InputError
from imclab.files import folder_written_whole
from imclab.scene import Scene
from imclab.transport import simulate
from imclab.twin.camera import VirtualCamera, choose_camera
from imclab.twin.folders import LABEL, write_calibration, write_experiment, write_stack
from imclab.twin.geometry import SHRINK, mounted, project

Energies = NDArray[np.float64]
Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class TwinPlan:
    """What the virtual rig does.

    Attributes
    ----------
    optical_depths : tuple of float
        One condition each, for each target; the first is the reference.
    masks : tuple of path
        Pictures of the targets; the scene's own when empty.
    frames : int
        Frames per condition.
    frame_shape : (rows, columns)
        Of the camera.
    rel_error : float
        To which the true pictures are simulated.
    seed : int
    """

    optical_depths: tuple[float, ...] = (0.42, 0.92, 1.42)
    masks: tuple[Path, ...] = ()
    frames: int = 8
    frame_shape: tuple[int, int] = (192, 192)
    rel_error: float = 0.002
    seed: int = 1


def make_twin(scene: Scene, folder: str | Path, plan: TwinPlan, *, progress: Progress | None = None) -> Path:
    """Write a synthetic experiment; return the path of its ``experiment.toml``.

    Parameters
    ----------
    scene : Scene
        The base scene; optical depth and target change from condition to condition.
    folder : path
        Must be empty or not exist. Gets ``experiment.toml``, ``scene.toml``, ``targets/``,
        ``frames/``, ``calibration/`` and ``truth.json``.
    plan : TwinPlan
    progress : callable, optional
        Told what is being made.

    Raises
    ------
    InputError
        When the folder holds something already.
    """
    with folder_written_whole(folder) as unfinished:
        _make(scene, unfinished, plan, progress or (lambda text: None))
    return Path(folder) / "experiment.toml"


def _make(scene: Scene, folder: Path, plan: TwinPlan, say: Progress) -> None:
    rng = np.random.default_rng(plan.seed)
    base = _copy_scene(scene, folder, plan)
    masks = sorted(path.name for path in (folder / "targets").iterdir()) or [""]
    pictures: dict[str, tuple[dict[str, Any], Energies]] = {}
    for mask in masks:
        for depth in plan.optical_depths:
            name = f"{Path(mask).stem or 'target'}-{depth:g}"
            say(f"true picture {name}")
            changes = _changes(base, mask, depth)
            true = simulate(base.with_(**changes), rel_error=plan.rel_error, seed=plan.seed + 7919)
            pictures[name] = (changes, true.energy)
    bright = {name: float(np.quantile(e, 0.99)) / SHRINK**2 for name, (_, e) in pictures.items()}
    camera, settings = choose_camera(
        bright, wavelength=scene.laser.wavelength, shape=plan.frame_shape, rng=rng
    )
    truth = _write_conditions(folder, pictures, camera, settings, plan, rng, say)
    say("calibration frames")
    offered = sorted(set(settings.values()))
    gate_ns = scene.gate.width * 1e9 if scene.gate else 0.0
    write_calibration(folder / "calibration", camera, offered, gate_ns=gate_ns, rng=rng)
    changes = {name: change for name, (change, _) in pictures.items()}
    write_experiment(folder, scene.title, changes, settings)
    truth["camera"] = camera.truth(offered)
    (folder / "truth.json").write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")


def _copy_scene(scene: Scene, folder: Path, plan: TwinPlan) -> Scene:
    """Put scene and targets into the folder, so that it can be moved as a whole."""
    (folder / "targets").mkdir()
    masks = plan.masks or ((scene.folder / scene.target.mask,) if scene.target.mask else ())
    missing = [mask for mask in masks if not mask.is_file()]
    if missing:
        raise InputError("targets", [Fault("mask", f'"{m}"', "a picture that exists") for m in missing])
    for mask in masks:
        shutil.copyfile(mask, folder / "targets" / mask.name)
    change = {"target.mask": f"targets/{masks[0].name}"} if masks else {}
    document = scene.with_(**{"target.mask": None}).document
    own = Scene.from_document(document, folder=folder, source="scene of the twin")
    own = own.with_(**change) if change else own
    (folder / "scene.toml").write_text(f"# {LABEL}\n{own.toml}", encoding="utf-8")
    return own


def depths_from_text(text: str) -> tuple[float, ...]:
    """Read optical depths separated by commas; anything but positive numbers is an `InputError`."""
    try:
        depths = tuple(float(part) for part in text.split(","))
    except ValueError:
        depths = ()
    if not depths or min(depths) <= 0:
        wanted = 'positive numbers such as "0.42,0.92,1.42"'
        raise InputError("optical depths", [Fault("optical-depths", f'"{text}"', wanted)])
    return depths


def _changes(scene: Scene, mask: str, depth: float) -> dict[str, Any]:
    """What of the scene changes to reach an optical depth over the target distance."""
    if scene.medium.particles is not None:
        changes: dict[str, Any] = {"medium.particles.optical_depth": depth}
    elif scene.medium.attenuation is not None:
        changes = {"medium.attenuation": f"{depth / scene.target.distance:.6g} 1/m"}
    else:
        wanted = "medium.attenuation with albedo, or particles: what the optical depth can be set by"
        raise InputError("scene", [Fault("medium", "water of another description", wanted)])
    if mask:
        changes["target.mask"] = f"targets/{mask}"
    return changes


def _write_conditions(
    folder: Path,
    pictures: dict[str, tuple[dict[str, Any], Energies]],
    camera: VirtualCamera,
    settings: dict[str, float],
    plan: TwinPlan,
    rng: np.random.Generator,
    say: Progress,
) -> dict[str, Any]:
    (folder / "frames").mkdir()
    truth: dict[str, Any] = {"label": LABEL, "synthetic": True, "seed": plan.seed, "conditions": {}}
    mounts: dict[str, Energies] = {}
    for name, (changes, energy) in pictures.items():
        say(f"frames {name}")
        target = name.rsplit("-", 1)[0]
        if target not in mounts:
            mounts[target] = mounted(energy.shape, plan.frame_shape, rng)
        matrix = mounts[target].copy()
        matrix[:2, 2] += rng.uniform(-0.3, 0.3, 2)  # the mount gives a little between conditions
        seen = project(energy, matrix, plan.frame_shape)
        stack = np.stack([camera.frame(seen, settings[name], rng) for _ in range(plan.frames)])
        write_stack(folder / "frames" / f"{name}.tif", stack)
        truth["conditions"][name] = {
            "changes": changes,
            "gain": settings[name],
            "matrix": matrix.tolist(),
            "energy_J": float(energy.sum()),
            "energy_on_camera_J": float(seen.sum()),
        }
    return truth
