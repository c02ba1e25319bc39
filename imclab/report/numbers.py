"""The report as one document of numbers: what `report.json` holds and the page shows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from imclab.agreement import Agreement, judged
from imclab.budget import DRAWN_INPUTS, part_of, parts_of
from imclab.comparison import Comparison, Outcome
from imclab.report.context import Context, Entry
from imclab.report.detail import Both, Detail
from imclab.sharpness import EdgeResponse
from imclab.uncertainty import COVERAGE_95, Estimate

SYNTHETIC_LABEL = "Synthetic data: made by a virtual rig, not measured"

REFERENCE, UNREGISTERED = "reference condition", "not registered"

_METRIC_UNITS = {"psnr": "dB"}

Document = dict[str, Any]


def document(
    comparison: Comparison, context: Context, *, agreement: Agreement, details: Sequence[Detail]
) -> Document:
    """Return everything the report says, ready for JSON.

    A number is ``{"value": ..., "unit": ...}``, perhaps with ``stderr`` (standard uncertainty, same
    unit), ``dof`` (its degrees of freedom, when few) and ``interval_95``; the unit of a pure number
    is "1". What is not finite is null, with a ``flag``.
    """
    return {
        "schema": 1,
        "title": comparison.title,
        "synthetic": comparison.synthetic,
        "label": SYNTHETIC_LABEL if comparison.synthetic else "",
        "verdict": _headline(comparison, agreement),
        "data_range": quantity(comparison.data_range, "counts"),
        "agreement": _agreement(agreement),
        "conditions": [
            _condition(outcome, seen, context)
            for outcome, seen in zip(comparison.outcomes, details, strict=True)
        ],
        "covariance": {
            "conditions": [outcome.pair.name for outcome in comparison.outcomes],
            **_array(comparison.covariance, "1"),
        },
        "calibration": [_entry(entry) for entry in context.calibration],
        "modelled": list(context.modelled),
        "left_out": _left_out(comparison),
        "provenance": [_entry(entry) for entry in context.provenance],
        "commands": list(context.commands),
    }


def quantity(value: float, unit: str, stderr: float | None = None) -> Document:
    """Return a number as `document` keeps it."""
    kept: Document = {"value": _finite(value), "unit": unit}
    if stderr is not None:
        kept["stderr"] = _finite(stderr)
    if not math.isfinite(value):
        kept["flag"] = "not a number" if math.isnan(value) else "infinite" if value > 0 else "minus infinite"
    return kept


def _finite(value: float) -> float | int | None:
    if isinstance(value, (int, np.integer)):
        return int(value)
    return float(value) if math.isfinite(value) else None


def _estimate(estimate: Estimate, unit: str = "1") -> Document:
    told = quantity(estimate.value, unit, estimate.stderr)
    told["interval_95"] = [_finite(end) for end in estimate.interval]
    return told | ({"dof": estimate.dof} if math.isfinite(estimate.dof) else {})


def _array(values: Any, unit: str) -> Document:
    return {"unit": unit, "values": _nested(np.asarray(values, dtype=float).tolist())}


def _nested(values: Any) -> Any:
    return [_nested(value) for value in values] if isinstance(values, list) else _finite(values)


def _entry(entry: Entry) -> Document:
    if isinstance(entry.value, str):
        return {"name": entry.name, "text": entry.value}
    told = {"name": entry.name, **quantity(entry.value, entry.unit or "1", entry.stderr)}
    return told | ({"setting": entry.setting} if entry.setting else {})


def verdict_of(outcome: Outcome) -> str:
    """Return the verdict on one condition in words."""
    if not outcome.pair.registration.ok:
        return UNREGISTERED
    return REFERENCE if outcome.reference == outcome.pair.name else outcome.error.verdict


def _headline(comparison: Comparison, agreement: Agreement) -> Document:
    outcomes = judged(comparison)
    inside = sum(abs(outcome.error.value) <= outcome.error.bound for outcome in outcomes)
    agreeing = sum(verdict_of(outcome).startswith("agrees") for outcome in outcomes)
    lost = sum(not outcome.pair.registration.ok for outcome in comparison.outcomes)
    if not outcomes:
        text = "Only reference conditions: there is no energy ratio to judge."
    else:
        total = len(outcomes)
        text = (
            f"{agreeing} of {total} energy ratios agree with the measurement within their uncertainty; "
            f"{inside} of {total} lie within ±{100 * agreement.bound:.0f} %."
        )
    if lost:
        text += f" {lost} condition{'s' if lost > 1 else ''} could not be registered."
    return {
        "text": text,
        "judged": quantity(len(outcomes), "1"),
        "inside": quantity(inside, "1"),
        "agreeing": quantity(agreeing, "1"),
        "not_registered": quantity(lost, "1"),
    }


def _agreement(agreement: Agreement) -> Document:
    altman = agreement.bland_altman
    return {
        "conditions": list(agreement.conditions),
        "chi_square": quantity(agreement.chi_square, "1"),
        "degrees_of_freedom": quantity(agreement.degrees_of_freedom, "1"),
        "reduced_chi_square": quantity(agreement.reduced_chi_square, "1"),
        "chi_square_probability": quantity(agreement.chi_square_probability, "1"),
        "area": quantity(agreement.area, "1"),
        "area_probability": quantity(agreement.area_probability, "1"),
        "bound": quantity(agreement.bound, "1"),
        "share_inside": quantity(agreement.share_inside, "1"),
        "probability_all": quantity(agreement.probability_all, "1"),
        "worst": agreement.worst,
        "worst_error": _estimate(agreement.worst_error),
        "worst_bound_95": quantity(agreement.worst_bound_95, "1"),
        "bias": _estimate(altman.bias),
        "lower_limit": quantity(altman.lower, "1"),
        "upper_limit": quantity(altman.upper, "1"),
        "trend_per_decade": _estimate(altman.trend),
        "mean": _array(altman.mean, "1"),
        "difference": _array(altman.difference, "1"),
    }


def _condition(outcome: Outcome, seen: Detail, context: Context) -> Document:
    pair, error = outcome.pair, outcome.error
    shares = error.shares
    return {
        "name": pair.name,
        "reference": outcome.reference,
        "is_reference": outcome.reference == pair.name,
        "verdict": verdict_of(outcome),
        "optical_depth": quantity(pair.optical_depth, "1"),
        "gain": quantity(pair.gain, "1"),
        "frames": quantity(pair.frames, "1"),
        "pixels": quantity(int(pair.region.sum()), "1"),
        "measured_ratio": _estimate(outcome.measured_ratio),
        "simulated_ratio": _estimate(outcome.simulated_ratio),
        "error": _estimate(Estimate(error.value, error.u_val, error.dof)),
        "error_over_uncertainty": quantity(error.value / error.u_val if error.u_val else math.nan, "1"),
        "uncertainty": quantity(error.u_val, "1"),
        "probability_inside": quantity(error.probability_inside, "1"),
        "bound": quantity(error.bound, "1"),
        "budget": {
            name: {
                "uncertainty": quantity(u, "1"),
                "share": quantity(shares[name], "1"),
                "part": part_of(name),
            }
            for name, u in error.budget.items()
        },
        "parts": {
            part: {"uncertainty": quantity(u, "1"), "share": quantity(_share(u, error.u_val), "1")}
            for part, u in parts_of(error.budget).items()
        },
        "inputs": _inputs(outcome),
        "throughput": _estimate(pair.throughput),
        "metrics": _metrics(outcome.metrics),
        "degradation": {
            "simulated": _metrics({name: both[0] for name, both in outcome.degradation.items()}),
            "with noise": _metrics(outcome.noisy_degradation),
            "measured": _metrics({name: both[1] for name, both in outcome.degradation.items()}),
        },
        "speed": _speed(outcome),
        "registration": _registration(outcome),
        "contrast": {
            "measured": _estimate(seen.contrast[0]),
            "simulated": _estimate(seen.contrast[1]),
        },
        "pixel_area": quantity(seen.pixel_area, "1"),
        "range_advice": seen.range_advice,
        "profiles": {"across": _profiles(seen.across), "down": _profiles(seen.down)},
        "edge": None
        if seen.edge is None
        else {"measured": _edge(seen.edge[0]), "simulated": _edge(seen.edge[1])},
        "time": _time(outcome),
        "gate": _gate(context.gates.get(pair.name)),
        "notes": list(pair.result.notes),
        "scene": pair.result.scene,
    }


def _share(u: float, whole: float) -> float:
    return u * u / whole**2 if whole > 0 else 0.0


def _inputs(outcome: Outcome) -> Document:
    """Tell the scene's uncertain inputs one by one, and whether draws of all of them say the same."""
    linear, drawn = math.hypot(*outcome.input_steps.values()), outcome.error.budget.get(DRAWN_INPUTS)
    told: Document = {
        "steps": {name: quantity(u, "1") for name, u in outcome.input_steps.items()},
        "linear": quantity(linear, "1"),
        "draws": quantity(outcome.input_draws, "1"),
        "drawn": None,
        "advice": "",
    }
    if drawn is not None:
        scatter = drawn / math.sqrt(2.0 * (outcome.input_draws - 1))
        told["drawn"] = quantity(drawn, "1", scatter)
        if abs(drawn - linear) > COVERAGE_95 * scatter:
            told["advice"] = (
                "one step of each input does not tell the whole: the answer is not linear in them"
            )
    return told


def _metrics(metrics: Mapping[str, Estimate]) -> Document:
    return {name: _estimate(value, _METRIC_UNITS.get(name, "1")) for name, value in metrics.items()}


def _speed(outcome: Outcome) -> Document:
    result = outcome.pair.result
    error = result.relative_error
    merit = 1.0 / (error**2 * result.cpu_seconds) if 0 < error < math.inf else math.nan
    return {
        "estimator": result.estimator,
        "seed": quantity(result.seed, "1"),
        "packets": quantity(result.packets, "1"),
        "cpu_seconds": quantity(result.cpu_seconds, "s"),
        "wall_seconds": quantity(result.wall_seconds, "s"),
        "threads": quantity(result.threads, "1"),
        "relative_error": quantity(error, "1"),
        "figure_of_merit": quantity(merit, "1/s"),
        "total": quantity(result.total, "J", result.total_stderr),
        "interrupted": result.interrupted,
    }


def _registration(outcome: Outcome) -> Document:
    found = outcome.pair.registration
    return {
        "ok": found.ok,
        "reason": found.reason,
        "quality": quantity(found.quality, "1"),
        "stderr": quantity(found.stderr_px, "px"),
        "target_stderr": quantity(found.target_stderr_px, "px"),
        "matrix": _array(found.matrix, "px"),
    }


def _profiles(both: Both) -> Document:
    return {
        "position": _array(both.measured.position, "px"),
        **{
            name: {"mean": _array(one.mean, "J"), "stderr": _array(one.stderr, "J")}
            for name, one in (("measured", both.measured), ("simulated", both.simulated))
        },
    }


def _edge(edge: EdgeResponse) -> Document:
    return {
        "angle": quantity(edge.angle, "rad"),
        "mtf50": _estimate(edge.mtf50, "cycles/px"),
        "frequency": _array(edge.frequency, "cycles/px"),
        "mtf": _array(edge.mtf, "1"),
        "mtf_stderr": _array(edge.mtf_stderr, "1"),
    }


def _time(outcome: Outcome) -> Document | None:
    result = outcome.pair.result
    if result.time_edges is None or result.time_energy is None or result.time_stderr is None:
        return None
    return {
        "edges": _array(result.time_edges, "s"),
        "energy": _array(result.time_energy, "J"),
        "stderr": _array(result.time_stderr, "J"),
    }


def _gate(gate: tuple[float, float] | None) -> Document | None:
    return None if gate is None else {"opens": quantity(gate[0], "s"), "closes": quantity(gate[1], "s")}


def _left_out(comparison: Comparison) -> list[str]:
    """Notes of all results, each once, in the order of the conditions."""
    notes = (note for outcome in comparison.outcomes for note in outcome.pair.result.notes)
    return list(dict.fromkeys(notes))
