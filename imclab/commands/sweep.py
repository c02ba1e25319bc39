"""``imclab sweep``: many scenes from one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from imclab.commands.console import JSON_OPTION, Progress, emit
from imclab.commands.run_options import Estimator, Packets, RelError, Seconds, Seed


def sweep(
    scene: Annotated[Path, typer.Argument(help="The scene file that all units start from.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for units, table and plot.")],
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help='KEY="VALUE,VALUE" or KEY="START to STOP in COUNT" (log behind it: equal ratios).',
        ),
    ] = None,
    zipped: Annotated[
        bool, typer.Option("--zip", help="Take the lists side by side instead of all combinations.")
    ] = False,
    one_way: Annotated[
        bool, typer.Option("--one-way", help="One way, as `imclab transmit`, instead of pictures.")
    ] = False,
    distances: Annotated[
        str | None, typer.Option(help='Planes of the one-way run, as "1 m, 5 m" or "1 m to 30 m in 10".')
    ] = None,
    rel_error: RelError = None,
    seconds: Seconds = None,
    packets: Packets = None,
    estimator: Estimator = None,
    seed: Seed = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a processor.")] = None,
    dask: Annotated[str | None, typer.Option(help="Scheduler of a Dask cluster, tcp://HOST:PORT.")] = None,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Run a scene with any of its keys over lists or ranges; the same command again resumes.

    Example: imclab sweep data/scenes/tank.toml --set medium.attenuation="0.42 1/m to 1.42 1/m in 6" -o DIR
    """
    from imclab.errors import Fault, InputError, InterruptedRunError
    from imclab.scene import load_scene
    from imclab.sweep import OneWay, SweepFailedError, parse_axis, parse_distances, plan, run, with_run

    if not settings:
        single = "imclab transmit" if one_way or distances else "imclab simulate"
        wanted = 'a key and its values, for example --set medium.attenuation="0.42 1/m,1.42 1/m"'
        raise InputError("--set", [Fault("--set", "nothing", wanted, f"For one scene: {single}")])
    base = with_run(
        load_scene(scene),
        rel_error=rel_error,
        seconds=seconds,
        packets=packets,
        estimator=estimator,
        seed=seed,
    )
    planes = OneWay(parse_distances(distances)) if one_way or distances else None
    axes = [parse_axis(setting) for setting in settings]
    units, refused = plan(base, axes, one_way=planes, zipped=zipped)
    progress = Progress()
    outcome = run(units, output, refused=refused, workers=workers, dask=dask, progress=progress)
    progress.close()
    words = f"{output}: {len(outcome.records)} of {len(units) + len(refused)} units finished"
    told = f"{words} ({outcome.resumed} found finished); see table.csv and plot.png"
    if outcome.other_units:
        told += f"\n  {outcome.other_units} results of other sweeps are kept there, but are not in the table"
    emit(outcome.summary() | {"folder": str(output)}, told, as_json=as_json)
    if outcome.interrupted:
        raise InterruptedRunError(f"interrupted; {words}. The same command continues.")
    if outcome.failures:
        raise SweepFailedError(outcome.failures, len(outcome.records))
