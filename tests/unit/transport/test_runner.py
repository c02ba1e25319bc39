from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest

from imclab.transport.groups import GroupLedger
from imclab.transport.runner import Estimator, MeanLedger, Reached, Until, run
from tests import judging


def normal_estimator(*, mean: float = 5.0, batch_size: int = 500, exact: float = 0.0) -> Estimator:
    """Histories of known law: normal numbers that follow from seed and history."""

    def batch(seed: int, first: int, count: int) -> dict[str, np.ndarray]:
        draws = np.random.default_rng([seed, first]).normal(mean, 2.0, count)
        return {"total": np.array([draws.sum()]), "picture": np.array([[draws.sum(), (draws**2).sum()]])}

    exacts = {"total": np.array([exact]), "picture": np.zeros((1, 2))} if exact else {}
    return Estimator("normal", batch, batch_size, exact=exacts)


def outcome(until: Until, *, threads: int = 1, seed: int = 1, **options: Any) -> tuple[MeanLedger, Any]:
    estimator = normal_estimator(**options)
    ledger = MeanLedger(estimator.exact, stop_at="total")
    return ledger, run(estimator, ledger, until, seed=seed, threads=threads)


def test_packets_are_counted_exactly_and_cut_into_enough_batches() -> None:
    ledger, effort = outcome(Until(packets=1001))
    assert effort.packets == ledger.histories == 1001
    assert effort.batches >= 31
    assert outcome(Until(packets=1))[1].packets == 1


def test_stated_errors_cover_the_truth() -> None:
    runs = [outcome(Until(packets=3200), seed=seed, batch_size=100)[0] for seed in range(400)]
    mean = np.array([ledger.mean("total")[0] for ledger in runs])
    stderr = np.array([ledger.stderr("total")[0] for ledger in runs])
    assert 0.63 < judging.coverage(mean, stderr, 5.0) < 0.73
    assert 0.93 < judging.coverage(mean, stderr, 5.0, errors=2.0) < 0.97
    assert judging.coverage(mean, 0.5 * stderr, 5.0) < 0.63


def test_uneven_batches_are_weighted() -> None:
    ledger = MeanLedger({}, stop_at="x")
    sizes, sums = np.array([100, 100, 7]), np.array([310.0, 290.0, 28.0])
    for count, value in zip(sizes, sums, strict=True):
        ledger.enter({"x": np.array([value])}, int(count))
    means = sums / sizes
    overall = sums.sum() / sizes.sum()
    expected = np.sqrt(np.sum(sizes * (means - overall) ** 2) / 2 / sizes.sum())
    assert ledger.mean("x")[0] == pytest.approx(overall, rel=1e-14)
    assert ledger.stderr("x")[0] == pytest.approx(expected, rel=1e-12)


def test_what_is_computed_is_added_without_error() -> None:
    plain, _ = outcome(Until(packets=3200))
    shifted, _ = outcome(Until(packets=3200), exact=100.0)
    assert shifted.mean("total")[0] == pytest.approx(plain.mean("total")[0] + 100.0)
    assert shifted.stderr("total") == plain.stderr("total")


def test_threads_do_not_change_a_bit() -> None:
    one, two, five = (outcome(Until(rel_error=0.002), threads=count) for count in (1, 2, 5))
    assert one[1].packets == two[1].packets == five[1].packets
    for name in ("total", "picture"):
        assert one[0].mean(name).tobytes() == two[0].mean(name).tobytes() == five[0].mean(name).tobytes()
        assert one[0].stderr(name).tobytes() == five[0].stderr(name).tobytes()


def test_a_relative_error_is_reached_and_not_much_more() -> None:
    ledger, effort = outcome(Until(rel_error=0.003))
    assert ledger.relative_error() <= 0.003
    # (2/5/0.003)^2 histories are needed
    assert 0.5 < effort.packets / (2.0 / 5.0 / 0.003) ** 2 < 2.0


def test_a_run_without_any_energy_ends_and_says_so() -> None:
    def nothing(seed: int, first: int, count: int) -> dict[str, np.ndarray]:
        return {"total": np.zeros(1)}

    estimator = Estimator("nothing", nothing, 10)
    effort = run(estimator, MeanLedger({}, stop_at="total"), Until(rel_error=0.01), threads=1)
    assert "no packet" in effort.notes[0]


def test_seconds_end_a_run() -> None:
    _, effort = outcome(Until(seconds=0.05))
    assert 0.05 <= effort.wall_seconds < 5.0


def test_progress_tells_what_was_reached() -> None:
    told: list[Reached] = []
    estimator = normal_estimator()
    run(estimator, MeanLedger({}, stop_at="total"), Until(packets=5000), threads=2, progress=told.append)
    assert [reached.packets for reached in told] == sorted(reached.packets for reached in told)
    assert told[-1].packets == 5000
    assert told[-1].rel_error < told[2].rel_error


def test_an_interruption_keeps_what_was_finished() -> None:
    def stop_at_ten(reached: Reached) -> None:
        if reached.batches == 10:
            raise KeyboardInterrupt

    ledger = MeanLedger({}, stop_at="total")
    effort = run(normal_estimator(), ledger, Until(packets=10**9), threads=2, progress=stop_at_ten)
    assert effort.interrupted
    assert ledger.batches == effort.batches + 0 == 10
    assert np.isfinite(ledger.stderr("total")).all()


def test_an_interruption_before_anything_is_finished_is_raised() -> None:
    started = threading.Event()

    def batch(seed: int, first: int, count: int) -> dict[str, np.ndarray]:
        if count:
            started.set()
            raise KeyboardInterrupt
        return {"total": np.zeros(1)}

    with pytest.raises(KeyboardInterrupt):
        run(Estimator("x", batch, 10), MeanLedger({}, stop_at="total"), Until(packets=100), threads=1)


def test_a_fault_in_a_batch_reaches_the_caller() -> None:
    def batch(seed: int, first: int, count: int) -> dict[str, np.ndarray]:
        if count:
            raise ZeroDivisionError
        return {"total": np.zeros(1)}

    with pytest.raises(ZeroDivisionError):
        run(Estimator("x", batch, 10), MeanLedger({}, stop_at="total"), Until(packets=100), threads=2)


def test_jackknife_errors_cover_a_quotient() -> None:
    quotients, errors = [], []
    for seed in range(200):
        draws = np.random.default_rng(seed).normal([2.0, 4.0], [1.0, 0.5], (3200, 2))
        ledger = GroupLedger({"pair": np.zeros(2), "sampled": np.zeros(1)}, sampled_share=1.0, stop_at="pair")
        for chunk in np.split(draws, 64):
            ledger.enter({"pair": chunk.sum(axis=0), "sampled": np.array([50.0])}, 50)
        value, stderr = ledger.jackknife(lambda means: means["pair"][:1] / means["pair"][1:])
        quotients.append(value[0])
        errors.append(stderr[0])
    assert 0.6 < judging.coverage(quotients, errors, 0.5) < 0.76
    assert judging.coverage(quotients, errors, 0.51) < 0.5


def test_the_median_part_may_stop_a_run() -> None:
    """One noisy pixel rules the largest error and leaves the median alone."""
    ledgers = [MeanLedger({}, stop_at="picture", median=median) for median in (False, True)]
    draws = np.random.default_rng(1).normal([1.0, 1.0, 1.0], [0.01, 0.02, 3.0], (400, 3))
    for row in draws:
        for ledger in ledgers:
            ledger.enter({"picture": row}, 1)
    largest, median = (ledger.relative_error() for ledger in ledgers)
    assert median == pytest.approx(0.02 / 20.0, rel=0.2)
    assert largest > 50.0 * median
