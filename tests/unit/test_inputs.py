"""Uncertain inputs of the scene: steps, joint draws, and what they come to in the budget."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from imclab.budget import PARTS, _drawn_effects, input_sources, part_of, parts_of
from imclab.inputs import joint_steps
from imclab.uncertainty import budget


def test_common_errors_are_one_for_all_conditions_and_own_errors_are_not() -> None:
    steps = joint_steps([True, False], conditions=3, draws=40, seed=1)
    assert steps.shape == (40, 3, 2)
    assert np.ptp(steps[:, :, 0], axis=1).max() == 0.0
    assert np.abs(np.corrcoef(steps[:, :, 1].T)[np.triu_indices(3, 1)]).max() < 0.5
    np.testing.assert_array_equal(steps, joint_steps([True, False], conditions=3, draws=40, seed=1))
    assert joint_steps([], conditions=3, draws=0, seed=1).shape == (0, 3, 0)


def test_few_draws_have_the_spread_of_many() -> None:
    """Twenty draws spread within 1.2 % of the normal law; twenty plain ones do not (power)."""
    rng = np.random.default_rng(1)
    sliced = [joint_steps([True], conditions=1, draws=20, seed=seed).std(ddof=1) for seed in range(30)]
    plain = [rng.standard_normal(20).std(ddof=1) for _ in range(30)]
    off_sliced, off_plain = (np.sqrt(np.mean((np.array(found) - 1) ** 2)) for found in (sliced, plain))
    assert off_sliced < 0.012
    assert off_plain > 0.1


def seen(answer: Any, draws: int = 200) -> list[Any]:
    """Three conditions of depth 0, 1 and 2 whose energy answers to one common error of 2 %."""
    steps = joint_steps([True], conditions=3, draws=draws, seed=2)[:, :, 0]
    return [
        SimpleNamespace(
            sighting=SimpleNamespace(
                input_effects={"medium.attenuation": (answer(depth, 1.0) - 1.0, True)},
                drawn_totals=tuple(answer(depth, step) for step in steps[:, depth]),
            )
        )
        for depth in range(3)
    ]


def both(answer: Any) -> tuple[float, float]:
    one_step = budget(input_sources(seen(answer), [0, 0, 0]), 2)["medium.attenuation"]
    return one_step, budget({"drawn": _drawn_effects(seen(answer), [0, 0, 0])}, 2)["drawn"]


def test_draws_agree_with_one_step_when_the_answer_is_nearly_linear() -> None:
    one_step, drawn = both(lambda depth, step: np.exp(-0.02 * depth * step))
    assert drawn == pytest.approx(0.04, rel=0.02)
    assert one_step == pytest.approx(drawn, rel=0.05)


def test_draws_see_what_one_step_does_not() -> None:
    one_step, drawn = both(lambda depth, step: 1 - 0.02 * depth * step * (step - 1))
    assert one_step == 0.0
    assert drawn > 0.04


def test_a_budget_has_three_parts() -> None:
    shares = {"Monte Carlo": 0.1, "calibration": 0.3, "registration": 0.4, "target.distance": 0.2}
    parts = parts_of(shares)
    assert tuple(parts) == PARTS
    assert parts == pytest.approx({"u_num": 0.1, "u_input": 0.2, "u_D": 0.5})
    assert [part_of(name) for name in shares] == ["u_num", "u_D", "u_D", "u_input"]
