"""What the supported generators are: grids, ranges, insertion delays, jitter, links.

Sources: SRS DG645 Operation and Service Manual rev. 1.1 (pages vii, 27, 42, 56-57); Quantum Composers
9500+ manual p. 42-44; limits of the 9520/BNC 575 family from the drivers that people run on them. The
155 ns of that family is not confirmed by a manual: measure your own box and give ``insertion``.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass

from rig.errors import Fault, PlanError


@dataclass(frozen=True)
class Model:
    """A kind of delay generator.

    Attributes
    ----------
    step_ps, shortest_width_ps, longest_ps : int
        The grid of delays and widths, the smallest legal width, the largest delay or width.
    insertion_ps, jitter_ps, accuracy_ps : int
        External trigger to the delay's zero; rms jitter; error of an uncalibrated delay.
    insertion_certain : bool
        Whether a maker's document states ``insertion_ps``.
    dead_time_ps : int
        What a cycle needs beyond its longest delay before the next trigger.
    outputs : tuple of str
        Pulse outputs; the first gates the tube unless said otherwise.
    baud : int
        The serial line's default.
    """

    name: str
    title: str
    step_ps: int
    shortest_width_ps: int
    longest_ps: int
    insertion_ps: int
    insertion_certain: bool
    jitter_ps: int
    accuracy_ps: int
    dead_time_ps: int
    outputs: tuple[str, ...]
    baud: int


_DG645 = Model(
    name="dg645",
    title="Stanford Research Systems DG645",
    step_ps=5,
    shortest_width_ps=5,
    longest_ps=1_999_999_999_999_995,
    insertion_ps=85_000,
    insertion_certain=True,
    jitter_ps=30,
    accuracy_ps=1_000,
    dead_time_ps=100_000,
    outputs=("AB", "CD", "EF", "GH"),
    baud=9600,
)
_BNC575 = Model(
    name="bnc575",
    title="Quantum Composers 9520/9530, BNC 575",
    step_ps=250,
    shortest_width_ps=10_000,
    longest_ps=999_999_999_999_750,
    insertion_ps=155_000,
    insertion_certain=False,
    jitter_ps=800,
    accuracy_ps=1_000,
    dead_time_ps=100_000,
    outputs=("A", "B", "C", "D"),
    baud=38400,
)
MODELS: dict[str, Model] = {"dg645": _DG645, "bnc575": _BNC575}
_ALSO_CALLED = {
    "srs645": "dg645",
    "bnc525": "bnc575",
    "qc9520": "bnc575",
    "qc9530": "bnc575",
    "9520": "bnc575",
    "9530": "bnc575",
    "575": "bnc575",
}


def model_named(name: str) -> Model:
    """Return the model called ``name``, whatever its case.

    Raises
    ------
    PlanError
        If no such model is known; the message names the nearest.
    """
    key = name.lower().replace("-", "").replace(" ", "")
    key = _ALSO_CALLED.get(key, key)
    if key not in MODELS:
        near = difflib.get_close_matches(key, [*MODELS, *_ALSO_CALLED], 1, 0.4)
        hint = f"Did you mean {near[0]!r}?" if near else ""
        raise PlanError("model", [Fault("model", repr(name), " or ".join(map(repr, MODELS)), hint)])
    return MODELS[key]


def output_named(box: Model, name: str | None) -> str:
    """Return the output called ``name`` (the first one when None), or refuse."""
    if name is None:
        return box.outputs[0]
    plain = name.upper().removeprefix("CH")
    if plain not in box.outputs:
        raise PlanError("output", [Fault("output", repr(name), f"one of {', '.join(box.outputs)}")])
    return plain
