"""``imclab twin``: a synthetic experiment from a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from imclab.commands.console import JSON_OPTION, Progress, emit
from imclab.commands.run_options import between_0_and_1


def twin(
    scene: Annotated[Path, typer.Argument(help="Scene file (TOML).", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder that is empty or does not exist.")],
    optical_depths: Annotated[
        str, typer.Option(help="One condition for each, separated by commas; the first is the reference.")
    ] = "0.42,0.92,1.42",
    mask: Annotated[
        list[Path] | None, typer.Option(help="Picture of a target; may be repeated. Else the scene's own.")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, help="Frames for each condition.")] = 8,
    rel_error: Annotated[
        float, typer.Option(callback=between_0_and_1, help="Relative error of the true pictures.")
    ] = 0.002,
    seed: Annotated[int, typer.Option(min=0, help="Of everything random.")] = 1,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Make a synthetic experiment and calibration folder, its truth kept beside it in truth.json."""
    from imclab.scene import load_scene
    from imclab.twin import TwinPlan, depths_from_text, make_twin

    plan = TwinPlan(
        optical_depths=depths_from_text(optical_depths),
        masks=tuple(mask or ()),
        frames=frames,
        rel_error=rel_error,
        seed=seed,
    )
    progress = Progress()
    try:
        experiment = make_twin(load_scene(scene), output, plan, progress=progress)
    finally:
        progress.close()
    words = f"Synthetic experiment: {experiment}\nNext: imclab report {experiment} -o report"
    emit({"experiment": str(experiment), "synthetic": True}, words, as_json=as_json)
