"""Options that say how long and how a run goes, the same for every command, checked before anything loads."""

from __future__ import annotations

import math
from typing import Annotated

import typer


def between_0_and_1(value: float | None) -> float | None:
    """Return a relative error that makes sense, else tell it under its option."""
    if value is not None and not 0.0 < value < 1.0:
        raise typer.BadParameter(f"got {value:g}; wanted a number above 0 and below 1: 0.02 is 2 %")
    return value


def _above_0(value: float | None) -> float | None:
    if value is not None and not 0.0 < value < math.inf:
        raise typer.BadParameter(f"got {value:g}; wanted a finite number above 0")
    return value


def _count_of_packets(value: float | None) -> float | None:
    if value is not None and not 1.0 <= value < math.inf:
        raise typer.BadParameter(f"got {value:g}; wanted a finite number, at least 1")
    return value


def _count_of_threads(value: int | None) -> int | None:
    if value is not None and value < 1:
        raise typer.BadParameter(f"got {value}; wanted at least 1; left out, all are used")
    return value


def _seed(value: int | None) -> int | None:
    if value is not None and not 0 <= value < 2**63:
        raise typer.BadParameter(f"got {value}; wanted 0 to 2^63 - 1")
    return value


RelError = Annotated[
    float | None,
    typer.Option("--rel-error", callback=between_0_and_1, help="Stop at this relative error: 0.02 is 2 %."),
]
PixelError = Annotated[
    float | None,
    typer.Option(
        "--pixel-error",
        callback=between_0_and_1,
        help="Stop when the median pixel has this relative error; instead of --rel-error.",
    ),
]
Seconds = Annotated[
    float | None,
    typer.Option("--seconds", callback=_above_0, help="Stop after so long; compiling does not count."),
]
Packets = Annotated[
    float | None, typer.Option("--packets", callback=_count_of_packets, help="Stop after so many packets.")
]
Seed = Annotated[
    int | None,
    typer.Option("--seed", callback=_seed, help="The random numbers follow from it; else that of the scene."),
]
Threads = Annotated[
    int | None, typer.Option("--threads", callback=_count_of_threads, help="Threads; default: all.")
]
Estimator = Annotated[
    str | None,
    typer.Option("--estimator", help="auto, analog, expected or two-sided; else that of the scene."),
]
