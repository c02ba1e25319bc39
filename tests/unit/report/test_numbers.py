from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from imclab.agreement import agreement
from imclab.budget import DRAWN_INPUTS
from imclab.comparison import Comparison
from imclab.report.detail import detail
from imclab.report.numbers import document, quantity
from imclab.uncertainty import Estimate
from tests.unit.report import made_up


def numbers_of(comparison: Comparison) -> dict[str, Any]:
    details = [detail(outcome.pair, data_range=comparison.data_range) for outcome in comparison.outcomes]
    return document(comparison, made_up.context(), agreement=agreement(comparison), details=details)


@pytest.fixture(scope="module")
def made() -> Comparison:
    return made_up.comparison(size=64)


def walk(value: Any, where: str = "") -> list[tuple[str, dict[str, Any]]]:
    """Every quantity of the document with its place."""
    if isinstance(value, dict):
        if "value" in value:
            return [(where, value)]
        return [found for key, item in value.items() for found in walk(item, f"{where}/{key}")]
    if isinstance(value, list):
        return [found for index, item in enumerate(value) for found in walk(item, f"{where}/{index}")]
    return []


def test_every_number_has_a_unit_and_json_can_hold_it(made: Comparison) -> None:
    numbers = numbers_of(made)
    assert json.loads(json.dumps(numbers, allow_nan=False)) == numbers
    quantities = walk(numbers)
    assert len(quantities) > 200
    for where, found in quantities:
        assert found["unit"], where
        assert (found["value"] is None) == ("flag" in found), where


def test_values_are_those_of_the_comparison(made: Comparison) -> None:
    numbers = numbers_of(made)
    for outcome, told in zip(made.outcomes, numbers["conditions"], strict=True):
        low, high = told["error"].pop("interval_95")
        assert told["error"] == {"value": outcome.error.value, "unit": "1", "stderr": outcome.error.u_val}
        assert high - low == pytest.approx(2 * 1.959964 * outcome.error.u_val, rel=1e-6)
        assert told["metrics"]["psnr"]["unit"] == "dB"
        assert told["speed"]["packets"]["value"] == outcome.pair.result.packets
        shares = [part["share"]["value"] for part in told["budget"].values()]
        assert sum(shares) == pytest.approx(0.0 if told["is_reference"] else 1.0)
        result = outcome.pair.result
        merit = 1 / (result.relative_error**2 * result.cpu_seconds)
        assert told["speed"]["figure_of_merit"]["value"] == pytest.approx(merit)


@pytest.mark.parametrize(
    ("value", "flag"), [(math.inf, "infinite"), (-math.inf, "minus infinite"), (math.nan, "not a number")]
)
def test_what_is_not_finite_is_null_with_a_flag(value: float, flag: str) -> None:
    assert quantity(value, "dB", math.nan) == {"value": None, "unit": "dB", "stderr": None, "flag": flag}


def test_numpy_numbers_become_plain_ones() -> None:
    told = quantity(np.int64(3), "1")
    assert type(told["value"]) is int
    assert type(quantity(np.float32(0.5), "1")["value"]) is float


def test_identical_pictures_have_an_infinite_psnr(made: Comparison) -> None:
    first = made.outcomes[0]
    alike = dataclasses.replace(first, metrics={"psnr": Estimate(math.inf, 0.0)})
    numbers = numbers_of(dataclasses.replace(made, outcomes=(alike, *made.outcomes[1:])))
    assert numbers["conditions"][0]["metrics"]["psnr"]["flag"] == "infinite"


def test_headline_counts_what_it_says(made: Comparison) -> None:
    told = numbers_of(made)["verdict"]
    assert told["text"].startswith("2 of 4 energy ratios agree")
    assert (told["judged"]["value"], told["inside"]["value"], told["agreeing"]["value"]) == (4, 4, 2)


def test_a_frame_that_was_not_registered_is_said_first(made: Comparison) -> None:
    outcome = made.outcomes[1]
    lost = dataclasses.replace(outcome.pair.registration, ok=False, reason="no target in the frame")
    changed = dataclasses.replace(outcome, pair=dataclasses.replace(outcome.pair, registration=lost))
    outcomes = (made.outcomes[0], changed, *made.outcomes[2:])
    numbers = numbers_of(dataclasses.replace(made, outcomes=outcomes))
    assert numbers["conditions"][1]["verdict"] == "not registered"
    assert numbers["verdict"]["text"].endswith("1 condition could not be registered.")
    assert numbers["verdict"]["agreeing"]["value"] == 1


def test_parts_of_the_budget_sum_to_one(made: Comparison) -> None:
    for told in numbers_of(made)["conditions"]:
        shares = [part["share"]["value"] for part in told["parts"].values()]
        assert sum(shares) == pytest.approx(0.0 if told["is_reference"] else 1.0)


@pytest.mark.parametrize(("drawn", "differs"), [(0.031, False), (0.06, True)])
def test_draws_that_differ_from_single_steps_are_told(made: Comparison, drawn: float, differs: bool) -> None:
    first = made.outcomes[1]
    kept = {"Monte Carlo": 0.01, DRAWN_INPUTS: drawn}
    outcome = dataclasses.replace(
        first,
        error=dataclasses.replace(first.error, budget=kept),
        input_steps={"medium.attenuation": 0.03},
        input_draws=20,
    )
    changed = dataclasses.replace(made, outcomes=(made.outcomes[0], outcome, *made.outcomes[2:]))
    told = numbers_of(changed)["conditions"][1]["inputs"]
    assert told["draws"]["value"] == 20
    assert told["drawn"]["value"] == drawn
    assert bool(told["advice"]) == differs
