"""``imclab bench``: speed against error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from imclab.commands.console import JSON_OPTION, Progress, emit


def bench(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for table, JSON and plot.")],
    scene: Annotated[
        Path | None, typer.Argument(help="A scene file; default: a target behind three waters.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.05, help="Seconds of the longest run.")] = 2.0,
    reference_seconds: Annotated[
        float | None, typer.Option(min=0.1, help="Seconds of the reference; default: ten times as long.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Seeds of each estimator.")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="First seed.")] = 1,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Measure every estimator: true and stated error against seconds, after validating it.

    Example: imclab bench data/scenes/lambertian_slit.toml -o bench
    """
    from imclab import bench as benches
    from imclab.bench.write import table, write
    from imclab.files import folder_written_whole
    from imclab.scene import load_scene

    scenes = benches.standard_scenes() if scene is None else {scene.stem: load_scene(scene)}
    options = benches.BenchOptions(
        seconds=seconds, reference_seconds=reference_seconds or 10.0 * seconds, seeds=seeds, seed=seed
    )
    progress = Progress()
    try:
        with folder_written_whole(output) as folder:
            measured = benches.bench(scenes, options, progress=progress)
            names = [path.name for path in write(measured, folder)]
    finally:
        progress.close()
    text = f"{table(measured)}\nwrote {', '.join(str(output / name) for name in names)}"
    emit(measured.document() | {"folder": str(output)}, text, as_json=as_json)
