"""Run an estimator in batches over threads until the stated error, the time or the packets are reached.

The contract between estimators and this module
-----------------------------------------------
An estimator module has one public function ``make(setup, ...) -> Estimator``. Its ``batch`` is called
as ``batch(seed, first_history, count)`` from several threads at once and returns a dictionary of
float64 arrays: for each quantity the SUM over the ``count`` histories numbered from
``first_history``, with every packet launched at weight 1 (so sums divided by counts are shares of
the pulse energy). The arrays are fresh for each call and the same keys and shapes come back always, also
for a ``count`` of 0, with which kernels are compiled before the clock starts.
The random numbers of a history follow from ``seed`` and its number alone. ``exact`` holds what was
computed instead of sampled, per packet, under the same keys; it is added to the means and has no
error. Estimators of pictures tally ``target`` and ``backscatter``, shaped (rows, columns), and
``time`` when the set-up has time bins; :mod:`imclab.transport.simulation` derives the rest.

Batches have one size, are started in order and counted in order, and the decision to stop is taken
after each in order: the bits of a result are the same for any number of threads. Memory does not
grow with packets, because each quantity keeps only its running mean and its running squared spread.
"""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Tally = Mapping[str, NDArray[np.float64]]
BatchFunction = Callable[[int, int, int], Tally]

FEWEST_BATCHES = 32
"""Batches that an error is stated from: with 31 degrees of freedom, 95 % lie within 2.04 of them."""
BATCHES_OF_NOTHING = 2000
"""A run for a relative error gives up when so many batches have brought no energy at all."""


@dataclass(frozen=True)
class Estimator:
    """A way to estimate what a scene returns; see the module's text for the contract."""

    name: str
    batch: BatchFunction
    batch_size: int
    exact: Tally = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Until:
    """When to stop: at the first of the limits that are given."""

    rel_error: float | None = None
    seconds: float | None = None
    packets: int | None = None


@dataclass(frozen=True)
class Reached:
    """What a progress callback is told after each batch."""

    batches: int
    packets: int
    seconds: float
    rel_error: float


@dataclass(frozen=True)
class Effort:
    """What a run took: packets emitted, batches, seconds of CPU inside kernels, seconds of wall clock."""

    packets: int
    batches: int
    cpu_seconds: float
    wall_seconds: float
    threads: int
    interrupted: bool = False
    notes: tuple[str, ...] = ()


class Ledger(Protocol):
    """What batches are entered into, in order."""

    def enter(self, tally: Tally, count: int) -> None:
        """Enter the sums of one batch of ``count`` histories."""

    def relative_error(self) -> float:
        """Return the relative standard error that can stop a run; infinite when it is not known."""


class MeanLedger:
    """Running means and standard errors from batches, by Welford's update with batch sizes as weights.

    With batch means m_i of n_i histories, sum n_i (m_i - m)^2 / (B - 1) estimates the variance of one
    history and the variance of the overall mean m is that over N (West 1979, CACM 22, 532).

    Parameters
    ----------
    exact : mapping
        What is computed per history, added to the means.
    stop_at : str
        Name of the quantity whose relative error stops a run.
    median : bool
        Whether it is the median of its parts that counts, such as the pixels of a picture, or the largest.
    """

    def __init__(self, exact: Tally, *, stop_at: str, median: bool = False) -> None:
        self._stop_at = stop_at
        self._median = median
        self.histories = 0
        self.batches = 0
        self._exact = dict(exact)
        self._means: dict[str, NDArray[np.float64]] = {}
        self._spreads: dict[str, NDArray[np.float64]] = {}

    def enter(self, tally: Tally, count: int) -> None:
        """Enter the sums of one batch of ``count`` histories."""
        self.histories += count
        self.batches += 1
        for name, sums in tally.items():
            batch_mean = sums / count
            if name not in self._means:
                self._means[name] = np.zeros_like(batch_mean)
                self._spreads[name] = np.zeros_like(batch_mean)
            deviation = batch_mean - self._means[name]
            self._means[name] += deviation * (count / self.histories)
            self._spreads[name] += count * deviation * (batch_mean - self._means[name])

    def names(self) -> tuple[str, ...]:
        """Return the quantities entered so far."""
        return tuple(self._means)

    def mean(self, name: str) -> NDArray[np.float64]:
        """Return the mean per history, what was computed exactly included."""
        exact = self._exact.get(name)
        return self._means[name].copy() if exact is None else self._means[name] + exact

    def stderr(self, name: str) -> NDArray[np.float64]:
        """Return the standard error of :meth:`mean`; infinite after a single batch."""
        if self.batches < 2:
            return np.full_like(self._spreads[name], np.inf)
        return np.sqrt(self._spreads[name] / ((self.batches - 1) * self.histories))

    def relative_error(self) -> float:
        """Return the largest, or median, relative standard error of the quantity that stops a run."""
        if self.batches < 2:
            return np.inf
        mean, stderr = np.abs(self.mean(self._stop_at)), self.stderr(self._stop_at)
        known = mean > 0.0
        if not known.any():
            return np.inf
        relative = stderr[known] / mean[known]
        return float(np.median(relative) if self._median else np.max(relative))


def run(
    estimator: Estimator,
    ledger: Ledger,
    until: Until,
    *,
    seed: int = 1,
    threads: int | None = None,
    progress: Callable[[Reached], None] | None = None,
) -> Effort:
    """Run batches until a limit of ``until`` is reached and enter them into the ledger.

    Parameters
    ----------
    estimator : Estimator
        What to run.
    ledger : Ledger
        Where the batches go; it is complete up to the last batch entered even after an interruption.
    until : Until
        At least one limit.
    seed : int
        Any integer from 0 to 2^64 - 1.
    threads : int, optional
        Threads to run batches on; as many as the process may use when left out.
    progress : callable, optional
        Called with a :class:`Reached` after each batch.

    Raises
    ------
    KeyboardInterrupt
        Only when no batch was finished; otherwise the interruption is told in the result.
    """
    count_threads = threads or len(os.sched_getaffinity(0))
    estimator.batch(seed, 0, 0)  # compiles, or loads from the cache on disk
    start = time.perf_counter()
    cpu_seconds, packets, batches, interrupted = 0.0, 0, 0, False

    def work(first: int, count: int) -> tuple[Tally, int, float]:
        before = time.thread_time()
        tally = estimator.batch(seed, first, count)
        return tally, count, time.thread_time() - before

    sizes = _batch_sizes(estimator.batch_size, until.packets)
    pool = ThreadPoolExecutor(max_workers=count_threads)
    pending: deque[Future[tuple[Tally, int, float]]] = deque()
    first = 0
    try:
        while True:
            while len(pending) < count_threads + 1 and (count := next(sizes, 0)):
                pending.append(pool.submit(work, first, count))
                first += count
            if not pending:
                break
            tally, count, cpu = pending.popleft().result()
            ledger.enter(tally, count)
            packets, batches, cpu_seconds = packets + count, batches + 1, cpu_seconds + cpu
            seconds = time.perf_counter() - start
            reached = Reached(batches, packets, seconds, ledger.relative_error())
            if progress is not None:
                progress(reached)
            if _enough(reached, until):
                break
    except KeyboardInterrupt:
        if not batches:
            raise
        interrupted = True
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    nothing = until.rel_error is not None and np.isinf(ledger.relative_error())
    notes = ("no packet brought any energy, so the relative error is not known",) if nothing else ()
    wall_seconds = time.perf_counter() - start
    return Effort(packets, batches, cpu_seconds, wall_seconds, count_threads, interrupted, notes)


def _batch_sizes(size: int, packets: int | None) -> Iterator[int]:
    """Yield the sizes of the batches: without an end, or adding up to ``packets``."""
    if packets is None:
        while True:
            yield size
    size = max(1, min(size, -(-packets // FEWEST_BATCHES)))
    for first in range(0, packets, size):
        yield min(size, packets - first)


def _enough(reached: Reached, until: Until) -> bool:
    if until.seconds is not None and reached.seconds >= until.seconds:
        return True
    if until.rel_error is None:
        return False
    if np.isinf(reached.rel_error):
        return reached.batches >= BATCHES_OF_NOTHING
    return reached.batches >= FEWEST_BATCHES and reached.rel_error <= until.rel_error
