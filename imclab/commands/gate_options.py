"""The options of ``imclab gate``: those of every plan, written once, and those of every port."""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

import rig
from imclab.commands.console import JSON_OPTION

_PLAN_HELP = {
    "distance": "Target distance, from where the beam enters the water: '12 m'.",
    "delay": "Instead of a distance: the delay to program, '340 ns'.",
    "model": "dg645 or bnc575 (also the QC 9520/9530).",
    "output": "Output that gates the tube: AB, A, ...",
    "width": "Gate width; default 3 ns, or the box's shortest.",
    "pulse": "Laser pulse duration; default 4.5 ns.",
    "convention": "front, centre or tail: where in the gate the return sits.",
    "tail_delay": "With tail: open so long after the return's leading edge.",
    "water": "fresh or sea.",
    "group_index": "The group index itself.",
    "temperature": "Of the water: '12 degC'.",
    "salinity": "g/kg.",
    "wavelength": "Default 532 nm.",
    "cable_in": "Photodiode to generator: '2 m', or a measured '10 ns'.",
    "cable_out": "Generator to tube.",
    "cable_delay": "Default 5 ns/m.",
    "photodiode": "Delay of the photodiode.",
    "insertion": "Trigger to T0; default the model's (85 ns for a DG645).",
    "pulser": "Delay of the gate pulser.",
    "tube": "Delay of the tube's opening.",
    "air_path": "Length of air on the light's way, out and back together.",
    "pretrigger": "How long the trigger comes before the light.",
    "offset": "One calibrated number in the place of all electronics.",
    "offset_uncertainty": "Its standard uncertainty.",
    "jitter": "Shot-to-shot rms of photodiode, pulser and tube.",
    "trigger": "What arming uses; default 'external rising'.",
    "rate": "The laser's repetition rate.",
    "polarity": "positive or negative.",
    "amplitude": "Of the gate's output: '2.5 V'.",
}

Port = Annotated[
    str | None, typer.Option(help="Serial device, pty, socket://host:port or rfc2217://host:port.")
]
Baud = Annotated[int | None, typer.Option(help="Of the serial line; default the model's.")]
Timeout = Annotated[str, typer.Option(help="How long the box may think.")]
LimitsFile = Annotated[Path | None, typer.Option(help="Limits file (TOML); required with --live.")]
JournalFile = Annotated[Path | None, typer.Option(help="Where every byte is written down before it is sent.")]
Live = Annotated[bool, typer.Option("--live", help="Send; without it this is a dry run.")]
AsJson = Annotated[bool, JSON_OPTION]
Model = Annotated[str, typer.Option(help="dg645 or bnc575 (also the QC 9520/9530).")]


def with_plan_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command every option of ``rig.plan_gate`` and a gate file; it gets the plan first."""

    @functools.wraps(command)
    def planned(gate: Path | None, **given: Any) -> None:
        chosen = {} if gate is None else rig.load_gate(gate)
        from_words = {name: given.pop(name) for name in _PLAN_HELP}
        chosen |= {name: value for name, value in from_words.items() if value is not None}
        command(rig.plan_gate(**chosen), **given)

    hints = typing.get_type_hints(command, include_extras=True)
    own = list(inspect.signature(command).parameters.values())[1:]
    words = {name: Annotated[str | None, typer.Option(help=text)] for name, text in _PLAN_HELP.items()}
    words["gate"] = Annotated[Path | None, typer.Option(help="Gate file (TOML) with any of these options.")]
    keyword = inspect.Parameter.KEYWORD_ONLY
    parameters = [
        inspect.Parameter(name, keyword, default=None, annotation=kind) for name, kind in words.items()
    ]
    parameters += [one.replace(kind=keyword, annotation=hints[one.name]) for one in own]
    planned.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    planned.__annotations__ = {one.name: one.annotation for one in parameters}
    del planned.__wrapped__  # type: ignore[attr-defined]
    return planned
