"""``imclab simulate``: the picture of a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from imclab.commands.console import JSON_OPTION, PREPARING, Progress, emit, told
from imclab.commands.run_options import Estimator, Packets, PixelError, RelError, Seconds, Seed, Threads


def simulate(
    scene: Annotated[Path, typer.Argument(help="The scene file.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The result, an HDF5 file.")],
    rel_error: RelError = None,
    seconds: Seconds = None,
    packets: Packets = None,
    pixel_error: PixelError = None,
    estimator: Estimator = None,
    seed: Seed = None,
    threads: Threads = None,
    time_bins: Annotated[
        int | None, typer.Option(min=0, max=1000, help="Bins of the time histogram; 0: none.")
    ] = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Tell what was left out and why.")] = False,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Simulate a picture, with the standard error of every pixel.

    Example: imclab simulate data/scenes/lambertian_slit.toml -o slit.h5 --rel-error 0.01
    """
    import imclab
    from imclab.errors import InterruptedRunError
    from imclab.files import check_output
    from imclab.transport.arrival import NOTHING, gate_beside_target
    from imclab.transport.setup import setup_of
    from imclab.transport.simulation import DEFAULT_TIME_BINS

    check_output(output)
    loaded = imclab.load_scene(scene)
    progress = Progress()
    progress(PREPARING)
    of = "the total" if pixel_error is None else "the median pixel"
    for note in gate_beside_target(loaded, setup_of(loaded)):
        progress(f"Note: {note}.", final=True)
    try:
        result = imclab.simulate(
            loaded,
            rel_error=rel_error,
            seconds=seconds,
            packets=packets,
            pixel_error=pixel_error,
            estimator=estimator,
            seed=seed,
            threads=threads,
            time_bins=DEFAULT_TIME_BINS if time_bins is None else time_bins,
            progress=lambda reached: progress(told(reached, of=of, goal=rel_error or pixel_error)),
        )
    finally:
        progress.close()
    result.save(output)
    summary = {
        "output": str(output),
        "total": result.total,
        "total_stderr": result.total_stderr,
        "relative_error": result.relative_error,
        "pixel_error": result.pixel_error,
        "target_total": result.target_total,
        "target_total_stderr": result.target_total_stderr,
        "backscatter_total": result.backscatter_total,
        "backscatter_total_stderr": result.backscatter_total_stderr,
        "estimator": result.estimator,
        "seed": result.seed,
        "packets": result.packets,
        "cpu_seconds": result.cpu_seconds,
        "wall_seconds": result.wall_seconds,
        "interrupted": result.interrupted,
        "notes": result.notes,
    }
    words = (
        f"{output}: {result.total:.5g} J +- {result.total_stderr:.2g} J "
        f"(backscatter {result.backscatter_total:.3g} J), {result.estimator}, "
        f"{result.packets:.3g} packets, {result.cpu_seconds:.2f} s of CPU"
    )
    notes = [note for note in result.notes if verbose or note.startswith(NOTHING)]
    emit(summary, "\n  ".join([words, *notes]), as_json=as_json)
    if result.interrupted:
        raise InterruptedRunError(f"interrupted; what was finished is in {output}")
