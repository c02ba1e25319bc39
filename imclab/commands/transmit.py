"""``imclab transmit``: one way through the water."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from imclab.commands.console import JSON_OPTION, PREPARING, Progress, emit, told
from imclab.commands.run_options import Packets, RelError, Seconds, Seed, Threads


def transmit(
    scene: Annotated[Path, typer.Argument(help="The scene file.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The result, an HDF5 file.")],
    distances: Annotated[
        str | None,
        typer.Option(help='Planes, as "0.5 m, 1 m" or "1 m to 30 m in 10"; default: the target\'s.'),
    ] = None,
    rel_error: RelError = None,
    seconds: Seconds = None,
    packets: Packets = None,
    seed: Seed = None,
    threads: Threads = None,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Send the pulse one way: energy through and back, spot and pulse widths at each plane.

    Example: imclab transmit data/scenes/jerlov_one_way.toml --distances "5 m, 10 m" -o one_way.h5
    """
    import imclab
    from imclab.errors import InterruptedRunError
    from imclab.files import check_output
    from imclab.sweep import parse_distances

    check_output(output)
    progress = Progress()
    progress(PREPARING)
    try:
        flux = imclab.transmit(
            imclab.load_scene(scene),
            distances=parse_distances(distances) or None,
            rel_error=rel_error,
            seconds=seconds,
            packets=packets,
            seed=seed,
            threads=threads,
            progress=lambda reached: progress(told(reached, goal=rel_error)),
        )
    finally:
        progress.close()
    flux.save(output)
    columns = ("transmitted", "reflected", "spot_fwhm", "spot_rms", "pulse_fwhm", "pulse_rms", "mean_path")
    summary = {"output": str(output), "distances": flux.distances, "seed": flux.seed}
    for name in (*columns, "reflected_mean_path"):
        summary |= {name: getattr(flux, name), f"{name}_stderr": getattr(flux, f"{name}_stderr")}
    summary |= {"absorbed": flux.absorbed, "packets": flux.packets, "cpu_seconds": flux.cpu_seconds}
    lines = [f"{output}: {flux.packets:.3g} packets, {flux.cpu_seconds:.2f} s of CPU"]
    lines += [
        f"  {distance:g} m: through {flux.transmitted[k]:.5g} +- {flux.transmitted_stderr[k]:.1g}, "
        f"back {flux.reflected[k]:.3g}, spot {1e3 * flux.spot_fwhm[k]:.4g} mm, "
        f"pulse {1e9 * flux.pulse_fwhm[k]:.5g} ns"
        for k, distance in enumerate(flux.distances)
    ]
    emit(summary, "\n".join(lines), as_json=as_json)
    if flux.interrupted:
        raise InterruptedRunError(f"interrupted; what was finished is in {output}")
