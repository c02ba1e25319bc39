"""``imclab study``: the paper's results again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from imclab.commands.console import JSON_OPTION, Progress, emit


def study(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder; each study gets one in it.")],
    files: Annotated[list[Path] | None, typer.Argument(help="Study files.")] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Every study of data/studies, or of --folder.")
    ] = False,
    folder: Annotated[Path, typer.Option(help="Where --all looks for study files.")] = Path("data/studies"),
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a processor.")] = None,
    dask: Annotated[str | None, typer.Option(help="Scheduler of a Dask cluster, tcp://HOST:PORT.")] = None,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Make results of the paper again and say which of its statements hold; the same command resumes.

    Example: imclab study --all -o paper
    """
    from imclab.errors import Fault, InputError
    from imclab.study import load_study, run_study
    from imclab.study.file import studies_in

    paths = [*(files or []), *(studies_in(folder) if everything else [])]
    if not paths:
        raise InputError("imclab study", [Fault("FILE", "nothing", "study files, or --all")])
    progress = Progress()
    conclusions = {}
    for loaded in [load_study(path) for path in paths]:
        progress(f"{loaded.shows}: {loaded.title}", final=True)
        conclusions[loaded.name] = run_study(
            loaded, output / loaded.name, workers=workers, dask=dask, progress=progress
        )
    progress.close()
    lines = [
        f"{'true ' if statement.true else 'FALSE'}  {conclusion.shows}: {statement.text} {statement.numbers}"
        for conclusion in conclusions.values()
        for statement in conclusion.statements
    ]
    summary = {name: conclusion.summary() for name, conclusion in conclusions.items()}
    emit({"folder": str(output), "studies": summary}, "\n".join(lines), as_json=as_json)
