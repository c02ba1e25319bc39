"""Run the units of a sweep, keep each result as a file, and go on where an earlier run stopped."""

from __future__ import annotations

import contextlib
import fcntl
from collections.abc import Callable, Generator, Iterator, Sequence
from pathlib import Path

from imclab.errors import Fault, InputError, OutputError
from imclab.files import check_folder
from imclab.sweep.outcome import Outcome
from imclab.sweep.plot import save_plot
from imclab.sweep.units import Refused, Unit
from imclab.sweep.workers import (
    Finished,
    Record,
    Work,
    available_processors,
    in_processes,
    in_this_process,
    on_cluster,
    perform,
)

ProgressCall = Callable[[str], None]


def run(
    units: Sequence[Unit],
    folder: str | Path,
    *,
    refused: Sequence[Refused] = (),
    workers: int | None = None,
    dask: str | None = None,
    progress: ProgressCall | None = None,
    work: Work = perform,
) -> Outcome:
    """Run what is not finished yet; write units, table and plot into ``folder``.

    The numbers are the same for any number of workers, here or on a cluster of like machines.

    Parameters
    ----------
    units : sequence of Unit
        Of `plan`.
    folder : path
        Each finished unit is a file in ``folder/units``, written whole or not at all.
    refused : sequence of Refused
        Combinations that make no scene, to be listed among the failures.
    workers : int, optional
        Processes of this machine; as many as processors, or units if these are fewer.
    dask : str, optional
        Address of a Dask scheduler to send the units to instead.
    progress : callable, optional
        Given one line of text after each unit.
    work : callable, optional
        What is done with a unit; `perform` save in tests.

    Returns
    -------
    Outcome
        A failed unit is listed in it and does not stop the others. An interruption (Ctrl-C) is told
        in it, too.

    Raises
    ------
    InputError, OutputError
        The cluster cannot be used; the folder cannot be written to, holds files of something else, or
        another sweep works in it.
    """
    folder = Path(folder)
    _refuse_other_files(folder)
    with _only_one_sweep(folder):
        records = {unit.index: found for unit in units if (found := _finished(unit, folder)) is not None}
        resumed, failures, interrupted = len(records), list(refused), False
        left = [unit for unit in units if unit.index not in records]
        stream = _stream(left, work, workers=workers, dask=dask)
        try:
            for unit, came in stream:
                if isinstance(came, BaseException):
                    failures.append(Refused(unit.index, unit.changes, str(came) or type(came).__name__))
                elif came.interrupted:
                    raise KeyboardInterrupt
                else:
                    came.save(_file(unit, folder))
                    records[unit.index] = came
                if progress is not None:
                    progress(f"{len(records)} of {len(units)} finished, {len(failures)} failed")
        except KeyboardInterrupt:
            interrupted = True
        finally:
            stream.close()
        outcome = Outcome(
            units=tuple(units),
            records=records,
            failures=tuple(sorted(failures, key=lambda failure: failure.index)),
            resumed=resumed,
            interrupted=interrupted,
            other_units=len({path.stem for path in (folder / "units").glob("*.h5")} - {u.key for u in units}),
        )
        outcome.save(folder)
        save_plot(outcome, folder / "plot.png")
    return outcome


def _stream(units: list[Unit], work: Work, *, workers: int | None, dask: str | None) -> Generator[Finished]:
    if dask is not None:
        return on_cluster(units, work, address=dask)
    processes = min(workers or available_processors(), max(1, len(units)))
    return in_this_process(units, work) if processes == 1 else in_processes(units, work, workers=processes)


def _file(unit: Unit, folder: Path) -> Path:
    return folder / "units" / f"{unit.key}.h5"


def _finished(unit: Unit, folder: Path) -> Record | None:
    """Return the unit's result if an earlier run has written it; a damaged file counts as none."""
    try:
        return unit.record_type.load(_file(unit, folder))
    except (InputError, OSError, KeyError, TypeError):
        return None


def _refuse_other_files(folder: Path) -> None:
    """Refuse a folder whose files a sweep has not written: it could overwrite one of them."""
    check_folder(folder)
    if folder.is_dir() and any(folder.iterdir()) and not (folder / "units" / ".lock").is_file():
        wanted = "a folder that is empty, not there yet, or holds an earlier sweep"
        raise InputError(str(folder), [Fault("output", "a folder with other files in it", wanted)])


@contextlib.contextmanager
def _only_one_sweep(folder: Path) -> Iterator[None]:
    """Hold the folder's lock; the system drops it when the process dies, however it dies."""
    try:
        (folder / "units").mkdir(parents=True, exist_ok=True)
        lock = (folder / "units" / ".lock").open("w")
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written to ({error.strerror or error})") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            advice = "Wait for it, or name another folder."
            raise InputError(
                str(folder),
                [
                    Fault(
                        "output", "a folder in which another sweep is at work", "a folder of its own", advice
                    )
                ],
            ) from None
        yield
