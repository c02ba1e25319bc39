"""The timing diagram of a gate plan as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rig import Fault, GatePlan, PlanError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def timing_diagram(plan: GatePlan) -> Figure:
    """Draw pulse, return and gate on one axis of time, with the delay's parts below.

    Parameters
    ----------
    plan : GatePlan

    Returns
    -------
    matplotlib.figure.Figure
        Times in ns after the pulse's leading edge enters the water.
    """
    from matplotlib.figure import Figure

    pulse, width = float(plan.pulse_ps) / 1e3, plan.width_ps / 1e3
    opens = float(plan.opening_ps) / 1e3
    returns = opens - float(plan.convention_ps) / 1e3
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    axes = figure.subplots()
    rows = (("pulse", 0.0, pulse), ("return", returns, returns + pulse), ("gate", opens, opens + width))
    for row, (name, rise, fall) in enumerate(rows):
        axes.barh(-row, fall - rise, left=rise, height=0.6, label=name)
        axes.annotate(f"{rise:.2f} ns", (rise, -row + 0.35), fontsize=8, ha="left", va="bottom")
    trigger = float(plan.opening_ps - plan.delay_ps) / 1e3
    axes.annotate(
        "",
        (opens, -3),
        (trigger, -3),
        arrowprops={"arrowstyle": "->", "color": "black"},
        annotation_clip=False,
    )
    axes.annotate(
        f"programmed delay {plan.delay_ps / 1e3:.3f} ns", ((opens + trigger) / 2, -2.9), ha="center"
    )
    axes.set_yticks([0, -1, -2, -3], ["pulse", "return", "gate", plan.model.name])
    axes.set_xlim(min(0.0, trigger) - pulse, 1.12 * max(opens + width, returns + pulse))
    axes.set_ylim(-3.6, 0.8)
    axes.set_xlabel("time after the pulse's leading edge enters the water (ns)")
    title = f"{plan.model.name} {plan.output}: {plan.convention}, {plan.convention_text}"
    axes.set_title(title, fontsize=9)
    return figure


def save_timing_diagram(plan: GatePlan, path: Path) -> None:
    """Draw the diagram into a file; its ending says the format.

    Raises
    ------
    PlanError
        If no picture has that ending.
    """
    formats = ("png", "pdf", "svg")
    if path.suffix.removeprefix(".").lower() not in formats:
        wanted = " or ".join(f"a name ending in .{ending}" for ending in formats)
        raise PlanError("timing diagram", [Fault("--plot", repr(str(path)), wanted)])
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    timing_diagram(plan).savefig(part, dpi=150)
    part.replace(path)
