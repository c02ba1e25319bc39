"""``imclab calibrate``: frames of known light in, a calibrated camera out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from imclab.commands.console import JSON_OPTION, Progress, emit


def calibrate(
    folder: Annotated[Path, typer.Argument(help="Folder with frames, frames.csv and camera.toml.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The calibration to write (HDF5).")],
    report: Annotated[
        Path | None, typer.Option("--report", help="Folder for a page of plots to judge the calibration by.")
    ] = None,
    pattern: Annotated[
        str | None,
        typer.Option(
            "--pattern",
            help="File names in place of frames.csv, like '{kind}/gain{gain}_E{energy_J}_*.tif' "
            "(columns in braces, * for anything).",
        ),
    ] = None,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Calibrate the camera: response, intensifier gain, noise, pixel maps, with uncertainties."""
    import calibration
    from imclab.files import check_folder, check_output
    from imclab.report.calibration_page import summary, write_page

    check_output(output)
    if report is not None:
        check_folder(report)
    progress = Progress()
    try:
        camera = calibration.calibrate(folder, pattern=pattern, progress=progress)
    finally:
        progress.close()
    camera.save(output)
    page = write_page(camera, report) if report is not None else None
    told = summary(camera)
    written = f"{output}, {page}" if page else f"{output}"
    data = {"output": str(output), "report": page and str(page), **told.data}
    emit(data, f"{told.text}\nwrote {written}", as_json=as_json)
