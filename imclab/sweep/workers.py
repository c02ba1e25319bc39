"""Where units run: in this process, in several processes of this machine, or on a Dask cluster.

Each way is a generator of (unit, what came of it) in the order of finishing; what came of it is the
record or the exception. Closing the generator ends the work.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable
from multiprocessing import connection
from multiprocessing.context import SpawnContext
from typing import Any

import imclab
from imclab.errors import Fault, ImclabError, InputError
from imclab.result import Flux, Result
from imclab.sweep.units import Unit

Record = Result | Flux
Work = Callable[[Unit, int | None], Record]
Finished = tuple[Unit, Record | BaseException]

MOST_DEATHS = 2
"""A unit whose worker has died so often is listed as failed: it is likely to be the cause."""
SECONDS_FOR_SCHEDULER = 5
"""How long the scheduler may take to answer."""
SECONDS_FOR_WORKER = 30
"""How long its first worker may take to appear."""


class WorkerDiedError(ImclabError, RuntimeError):
    """The process that ran a unit ended without a word: killed, or out of memory."""


def perform(unit: Unit, threads: int | None) -> Record:
    """Run one unit; the work that all three ways are given, save in tests."""
    return unit.perform(threads)


def available_processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0))


def in_this_process(units: Iterable[Unit], work: Work) -> Generator[Finished]:
    """Run unit after unit, each on all processors."""
    for unit in units:
        try:
            yield unit, work(unit, None)
        except Exception as error:
            yield unit, error


class _Lane:
    """A worker process and the pipe to it."""

    def __init__(self, context: SpawnContext, work: Work, threads: int) -> None:
        self.pipe, its_end = context.Pipe()
        self.process = context.Process(target=_serve, args=(its_end, work, threads), daemon=True)
        self.process.start()
        its_end.close()
        self.unit: Unit | None = None

    def start(self, unit: Unit) -> None:
        self.unit = unit
        # A worker that has died meanwhile is noticed where its answer is read.
        with contextlib.suppress(OSError):
            self.pipe.send(unit)

    def answer(self) -> Record | BaseException:
        try:
            outcome: Record | BaseException = self.pipe.recv()
        except (EOFError, OSError):
            self.process.join()
            return WorkerDiedError(f"its worker process died (exit code {self.process.exitcode})")
        return outcome

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


def _serve(pipe: connection.Connection, work: Work, threads: int) -> None:
    """Answer units until the pipe closes; runs in the worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what an interruption means
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(EOFError, OSError):
        while True:
            unit = pipe.recv()
            try:
                outcome: Record | BaseException = work(unit, threads)
            except Exception as error:
                outcome = _sendable(error)
            pipe.send(outcome)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _sendable(error: Exception) -> Exception:
    """Return the error if it survives the way to the parent, else its words."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # pickling runs the error's own code, which may raise anything
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def in_processes(units: Iterable[Unit], work: Work, *, workers: int) -> Generator[Finished]:
    """Run units in ``workers`` processes; one that dies costs its unit one more start, no more."""
    context = multiprocessing.get_context("spawn")  # a forked child may hang in numba's or BLAS's threads
    threads = max(1, available_processors() // workers)
    waiting, deaths = deque(units), Counter[int]()
    idle: list[_Lane] = []
    busy: dict[Any, _Lane] = {}
    try:
        while waiting or busy:
            while waiting and len(busy) < workers:
                lane = idle.pop() if idle else _Lane(context, work, threads)
                lane.start(waiting.popleft())
                busy[lane.pipe] = lane
            for pipe in connection.wait(list(busy)):
                lane = busy.pop(pipe)
                unit, outcome = lane.unit, lane.answer()
                assert unit is not None
                if not isinstance(outcome, WorkerDiedError):
                    idle.append(lane)
                    yield unit, outcome
                    continue
                lane.end()
                deaths[unit.index] += 1
                if deaths[unit.index] < MOST_DEATHS:
                    waiting.appendleft(unit)
                else:
                    yield unit, outcome
    finally:
        for lane in [*idle, *busy.values()]:
            lane.end()


def on_cluster(units: Iterable[Unit], work: Work, *, address: str) -> Generator[Finished]:
    """Run units on the Dask cluster whose scheduler listens at ``address``, one thread each.

    Raises
    ------
    InputError
        Dask is not installed, nobody answers, no worker is there, or the workers have another
        imclab.
    """
    try:
        import distributed
    except ImportError:
        advice = 'Install it with: python -m pip install "imclab[cluster]"'
        raise InputError("--dask", [Fault("dask", "not installed", "dask and distributed", advice)]) from None
    wanted = "the address of a running scheduler, for example tcp://127.0.0.1:8786"
    try:
        distributed.comm.get_address_host_port(address)
    except ValueError:  # told here, because a client made with such an address does not close quietly
        raise InputError("--dask", [Fault("scheduler", f'"{address}"', wanted)]) from None
    try:
        client = distributed.Client(address, timeout=SECONDS_FOR_SCHEDULER, set_as_default=False)
    except (OSError, TimeoutError) as error:
        came = f"{address}, where no scheduler answers ({type(error).__name__})"
        raise InputError(
            "--dask", [Fault("scheduler", came, wanted, "Start one with: dask scheduler")]
        ) from None
    with client:
        _check_workers(client, address)
        futures = {
            client.submit(work, unit, 1, key=f"imclab-{unit.key}-{os.getpid()}", pure=False): unit
            for unit in units
        }
        for future in distributed.as_completed(list(futures), loop=client.loop):
            failure = future.exception()
            yield futures.pop(future), future.result() if failure is None else failure


def _check_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=SECONDS_FOR_WORKER)
    except TimeoutError:
        advice = f"Start one with: dask worker {address}"
        raise InputError("--dask", [Fault(address, "no worker", "at least one worker", advice)]) from None
    faults = [
        Fault(f"worker {worker}", version, f"imclab {imclab.__version__}", "Install the same imclab there.")
        for worker, version in client.run(_version_here, on_error="return").items()
        if version != f"imclab {imclab.__version__}"
    ]
    if faults:
        raise InputError("--dask", [Fault(f.where, str(f.came), f.wanted, f.advice) for f in faults])


def _version_here() -> str:
    return f"imclab {imclab.__version__}"
