"""Run a study: its scenes as a sweep, then its conclusion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from imclab.errors import InterruptedRunError
from imclab.result import Flux, Result
from imclab.study import broadening, echo, energy, pictures
from imclab.study.conclusion import Conclusion
from imclab.study.file import Study
from imclab.sweep import SweepFailedError, run

Conclude = Callable[[Study, Sequence[Result | Flux]], Conclusion]

CONCLUDE: dict[str, Conclude] = {
    "broadening": broadening.conclude,
    "echo": echo.conclude,
    "energy": energy.conclude,
    "pictures": pictures.conclude,
}


def run_study(
    study: Study,
    folder: str | Path,
    *,
    workers: int | None = None,
    dask: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> Conclusion:
    """Run what of a study is not finished, draw its conclusion and save both in ``folder``.

    Raises
    ------
    SweepFailedError
        When scenes failed: there is no conclusion then.
    InterruptedRunError
        After Ctrl-C; the same call continues.
    """
    folder = Path(folder)
    outcome = run(study.units, folder, workers=workers, dask=dask, progress=progress)
    if outcome.interrupted:
        raise InterruptedRunError(f"{folder}: interrupted; the same command continues")
    if outcome.failures:
        raise SweepFailedError(outcome.failures, len(outcome.records))
    conclusion = CONCLUDE[study.kind](study, [outcome.records[unit.index] for unit in study.units])
    conclusion.save(folder)
    return conclusion
