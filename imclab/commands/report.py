"""``imclab report``: the validation report of an experiment."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from imclab.commands.console import JSON_OPTION, Progress, emit
from imclab.commands.run_options import Threads, between_0_and_1


def report(
    experiment: Annotated[
        Path | None, typer.Argument(help="Experiment file (TOML).", show_default=False)
    ] = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder: empty, new, or of an earlier run.")
    ] = Path("report"),
    rel_error: Annotated[
        float | None,
        typer.Option(
            callback=between_0_and_1, help="Relative error of each simulated picture; else the experiment's."
        ),
    ] = None,
    threads: Threads = None,
    from_saved: Annotated[
        Path | None, typer.Option(help="Render the page again from this report's saved numbers.")
    ] = None,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Simulate, register and compare every condition of an experiment; write one page and its numbers."""
    if (experiment is None) == (from_saved is None):
        raise typer.BadParameter("name either an experiment file or --from-saved FOLDER")
    progress = Progress()
    if from_saved is not None:
        from imclab.report.run import render_again

        made = render_again(from_saved)
    else:
        from imclab.report.run import run_report

        assert experiment is not None
        try:
            made = run_report(experiment, output, rel_error=rel_error, threads=threads, progress=progress)
        finally:
            progress.close()
    emit(made.summary(), made.words(), as_json=as_json)
