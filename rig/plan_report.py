"""A gate plan for people and for machines: a table, a diagram in text, a dictionary."""

from __future__ import annotations

from typing import Any

from rig.quantity import engineering_time
from rig.timing import GatePlan

_COLUMNS = 64


def plan_dict(plan: GatePlan) -> dict[str, Any]:
    """Return the plan as plain numbers and names, ready for JSON."""
    near, far = plan.slice_m
    return {
        "model": plan.model.name,
        "output": plan.output,
        "delay_ps": plan.delay_ps,
        "width_ps": plan.width_ps,
        "wanted_delay_ps": round(float(plan.wanted_delay_ps), 6),
        "quantisation_ps": round(float(plan.quantisation_ps), 6),
        "quantisation_mm": float(plan.quantisation_ps) * plan.metres_per_ps * 1e3,
        "resolution_ps": plan.model.step_ps,
        "distance_m": None if plan.distance_m is None else float(plan.distance_m),
        "group_index": float(plan.group_index),
        "range_per_ns_m": plan.metres_per_ps * 1e3,
        "convention": plan.convention,
        "convention_meaning": plan.convention_text,
        "parts_ps": {part.name: round(float(part.time_ps), 6) for part in plan.parts},
        "opens_after_leading_edge_ps": round(float(plan.opening_ps), 6),
        "opens_after_pulse_peak_ps": round(float(plan.opening_ps - plan.pulse_ps / 2), 6),
        "pulse_ps": float(plan.pulse_ps),
        "slice_near_m": near,
        "slice_far_m": far,
        "depth_of_field_m": plan.depth_m,
        "reach_floor_m": plan.reach_floor_m,
        "jitter_ps": plan.jitter_ps,
        "jitter_mm": plan.jitter_ps * plan.metres_per_ps * 1e3,
        "uncertainty_ps": plan.uncertainty_ps,
        "uncertainty_mm": plan.uncertainty_ps * plan.metres_per_ps * 1e3,
        "uncertainty_source": plan.uncertainty_source,
        "trigger": plan.trigger,
        "rate_hz": None if plan.rate_hz is None else float(plan.rate_hz),
        "notes": list(plan.notes),
    }


def plan_table(plan: GatePlan) -> str:
    """Return the plan as a table."""
    values = plan_dict(plan)
    depth = plan.depth_m
    rows = [(part.name, f"{float(part.time_ps) / 1e3:+.4f} ns") for part in plan.parts if part.time_ps]
    rows += [
        ("delay wanted", f"{float(plan.wanted_delay_ps) / 1e3:.6f} ns"),
        (f"delay on the {plan.model.step_ps} ps grid", engineering_time(plan.delay_ps)),
        ("rounding", f"{values['quantisation_ps']:+.3f} ps = {values['quantisation_mm']:+.4f} mm"),
        ("width", engineering_time(plan.width_ps)),
        ("convention", f"{plan.convention}: {plan.convention_text}"),
        ("group index", f"{float(plan.group_index):.6g} ({values['range_per_ns_m'] * 100:.3f} cm per ns)"),
        (
            "tube opens",
            f"{float(plan.opening_ps) / 1e3:.4f} ns after the pulse's leading edge enters the water",
        ),
        ("seen from, to", f"{values['slice_near_m']:.3f} m, {values['slice_far_m']:.3f} m"),
        (
            "depth of field",
            f"{depth['full']:.3f} m full, {depth['flat']:.3f} m flat, {depth['fwhm']:.3f} m FWHM",
        ),
        ("reach floor", f"{plan.reach_floor_m:.2f} m"),
        ("jitter", f"{plan.jitter_ps:.0f} ps rms = {values['jitter_mm']:.1f} mm"),
        (
            "uncertainty",
            f"{plan.uncertainty_ps:.0f} ps = {values['uncertainty_mm']:.0f} mm, {plan.uncertainty_source}",
        ),
    ]
    wide = max(len(name) for name, _ in rows)
    title = f"{plan.model.title}, output {plan.output}"
    return "\n".join([title, *(f"  {name:<{wide}}  {value}" for name, value in rows), *plan.notes])


def plan_diagram(plan: GatePlan) -> str:
    """Return a timing diagram in text: the pulse, its return, the gate, on one axis of time."""
    pulse, gate = float(plan.pulse_ps), float(plan.width_ps)
    opens = float(plan.opening_ps)
    returns = opens - float(plan.convention_ps)
    begin = min(opens, returns)
    end = max(opens + gate, returns + pulse)
    margin = (end - begin) / 4
    start, stop = begin - margin, end + margin

    def row(name: str, rise: float, fall: float) -> str:
        edges = [start + (column + 0.5) * (stop - start) / _COLUMNS for column in range(_COLUMNS)]
        drawn = "".join("█" if rise <= time < fall else "▁" for time in edges)
        return f"{name:>7} {drawn}"

    left, right = f"{start / 1e3:.2f} ns", f"{stop / 1e3:.2f} ns"
    return "\n".join(
        [
            row("return", returns, returns + pulse),
            row("gate", opens, opens + gate),
            f"{'':8}{left}{right:>{_COLUMNS - len(left)}}",
            f"{'':8}after the pulse's leading edge enters the water",
        ]
    )
