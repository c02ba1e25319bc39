"""A sweep keeps its promises: resumes, lists failures, and gives the same numbers for any workers."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure

from imclab.errors import InputError
from imclab.sweep import Axis, OneWay, SweepFailedError, Unit, plan, plot, run, with_run
from imclab.sweep.workers import Work
from tests.unit import sweep_work


def seeds(*values: int) -> list[Unit]:
    return plan(sweep_work.scene(), [Axis("run.seed", values)])[0]


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "table.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def run_here(units: list[Unit], folder: Path, work: Work = sweep_work.result_of, **options: Any) -> Any:
    return run(units, folder, work=work, **{"workers": 1} | options)


def test_one_row_a_unit_in_si_units(tmp_path: Path) -> None:
    axes = [Axis("medium.attenuation", ("0.42 1/m", "1.42 1/m")), Axis("run.seed", (1, 2))]
    units, _ = plan(sweep_work.scene(), axes)
    run_here(units, tmp_path)
    rows = table(tmp_path)
    assert [float(row["medium.attenuation"]) for row in rows] == [0.42, 0.42, 1.42, 1.42]
    assert [row["run.seed"] for row in rows] == ["1", "2", "1", "2"]
    with h5py.File(tmp_path / "table.h5") as file:
        assert file["table/total"][()].tolist() == [float(row["total"]) for row in rows]
        assert file["table/status"].asstr()[()].tolist() == ["done"] * 4
    assert (tmp_path / "plot.png").stat().st_size > 1000


def test_one_way_has_one_row_a_plane(tmp_path: Path) -> None:
    units, _ = plan(
        sweep_work.scene(), [Axis("medium.attenuation", ("0.42 1/m", "1 1/m"))], one_way=OneWay((1.0, 5.0))
    )
    run_here(units, tmp_path, sweep_work.flux_of)
    rows = table(tmp_path)
    assert [float(row["distance"]) for row in rows] == [1.0, 5.0, 1.0, 5.0]
    assert float(rows[3]["transmitted"]) == np.exp(-5.0)


def test_a_finished_unit_is_not_run_again_and_a_wider_sweep_keeps_it(tmp_path: Path) -> None:
    run_here(seeds(1, 2), tmp_path)
    again = run_here(seeds(1, 2), tmp_path, sweep_work.forbidden)
    assert again.resumed == 2
    assert not again.failures
    wider = run_here(seeds(1, 2, 3), tmp_path)
    assert (wider.resumed, len(wider.records)) == (2, 3)


def test_a_changed_scene_mask_or_limit_is_run_again(tmp_path: Path) -> None:
    base = sweep_work.scene()
    keys = {
        unit.key
        for scene in (base, with_run(base, rel_error=0.1), base.with_(**{"medium.albedo": 0.5}))
        for one_way in (None, OneWay((1.0,)))
        for unit in plan(scene, [], one_way=one_way)[0]
    }
    assert len(keys) == 6


def test_a_damaged_unit_is_run_again(tmp_path: Path) -> None:
    units = seeds(1, 2)
    run_here(units, tmp_path)
    (tmp_path / "units" / f"{units[0].key}.h5").write_bytes(b"half a file")
    assert run_here(units, tmp_path).resumed == 1


@pytest.mark.parametrize("workers", [1, 2])
def test_a_failing_unit_is_listed_and_the_rest_finished(tmp_path: Path, workers: int) -> None:
    outcome = run_here(seeds(1, 2, 3, 4), tmp_path, sweep_work.fails_on_odd_seeds, workers=workers)
    assert sorted(outcome.records) == [1, 3]
    assert [failure.reason for failure in outcome.failures] == ["seed 1 is odd", "seed 3 is odd"]
    assert [row["status"] for row in table(tmp_path)] == ["failed", "done", "failed", "done"]
    assert "unit 2 (run.seed = 3): seed 3 is odd" in str(SweepFailedError(outcome.failures, 2))


def test_a_worker_killed_once_costs_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SWEEP_WORK_MARKER", str(tmp_path / "died"))
    outcome = run_here(seeds(1, 2, 3, 4), tmp_path / "a", sweep_work.dies_once_on_seed_3, workers=2)
    assert (tmp_path / "died").exists()
    assert not outcome.failures
    run_here(seeds(1, 2, 3, 4), tmp_path / "b")
    assert table(tmp_path / "a") == table(tmp_path / "b")


def test_a_unit_that_kills_its_workers_is_listed(tmp_path: Path) -> None:
    outcome = run_here(seeds(1, 2, 3, 4), tmp_path, sweep_work.dies_on_seed_3, workers=2)
    assert sorted(outcome.records) == [0, 1, 3]
    assert "worker process died (exit code -9)" in outcome.failures[0].reason


def test_an_interruption_keeps_what_is_finished(tmp_path: Path) -> None:
    outcome = run_here(seeds(1, 2, 3, 4), tmp_path, sweep_work.interrupts_on_seed_3)
    assert outcome.interrupted
    assert len(table(tmp_path)) == 2
    finished = run_here(seeds(1, 2, 3, 4), tmp_path)
    assert (finished.resumed, len(finished.records)) == (2, 4)


def test_tables_are_equal_byte_for_byte_for_any_number_of_workers(tmp_path: Path) -> None:
    for workers in (1, 2, 4):
        run_here(seeds(*range(8)), tmp_path / str(workers), workers=workers)
    for name in ("table.csv", "table.h5"):
        assert len({(tmp_path / str(workers) / name).read_bytes() for workers in (1, 2, 4)}) == 1, name


def test_combinations_that_make_no_scene_are_failures_beside_others_and_faults_alone() -> None:
    units, refused = plan(sweep_work.scene(), [Axis("medium.albedo", (0.5, 1.5))])
    assert [unit.index for unit in units] == [0]
    assert "medium.albedo: got 1.5" in refused[0].reason
    with pytest.raises(InputError, match='Did you mean "albedo"'):
        plan(sweep_work.scene(), [Axis("medium.albedoo", (0.5, 0.6))])


def test_a_limit_asked_for_replaces_the_one_of_the_scene() -> None:
    run_part = with_run(sweep_work.scene(), rel_error=0.1, seed=5).run
    assert (run_part.packets, run_part.rel_error, run_part.seed) == (None, 0.1, 5)
    assert with_run(sweep_work.scene(), seed=None).run.packets == 1000
    with pytest.raises(InputError, match="only one of"):
        with_run(sweep_work.scene(), rel_error=0.1, packets=10)


def test_two_sweeps_do_not_share_a_folder(tmp_path: Path) -> None:
    def nested(unit: Unit, threads: int | None) -> Any:
        with pytest.raises(InputError, match="another sweep is at work"):
            run_here(seeds(2), tmp_path)
        return sweep_work.result_of(unit, threads)

    assert not run_here(seeds(1), tmp_path, nested).failures


def test_files_of_something_else_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("mine")
    with pytest.raises(InputError, match="other files in it"):
        run_here(seeds(1), tmp_path, sweep_work.forbidden)
    assert (tmp_path / "table.csv").read_text() == "mine"


def test_results_of_other_sweeps_in_the_folder_are_counted_and_kept(tmp_path: Path) -> None:
    assert run_here(seeds(1, 2, 3), tmp_path).other_units == 0
    narrower = run_here(seeds(3, 4), tmp_path)
    assert (narrower.other_units, narrower.resumed) == (2, 1)
    assert run_here(seeds(1, 2), tmp_path, sweep_work.forbidden).resumed == 2


@pytest.mark.parametrize("address", ["nonsense", "foo://bar:1", "tcp://host"])
def test_an_address_that_is_none_is_told_at_once(tmp_path: Path, address: str) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(InputError, match="the address of a running scheduler"):
        run_here(seeds(1), tmp_path, dask=address)


def drawn(units: list[Unit], tmp_path: Path) -> Figure:
    """The plot of a sweep, as it was before it became a file."""
    outcome = run_here(units, tmp_path)
    return plot.figure_of(outcome)


def test_the_plot_names_units_and_only_what_tells_lines_apart(tmp_path: Path) -> None:
    depths = Axis("medium.attenuation", ("0.42 1/m", "1 1/m", "1.42 1/m"))
    other = Axis("laser.spot_fwhm", ("1 mm", "2 mm", "3 mm"))
    constant = Axis("medium.albedo", (0.5,))
    zipped = drawn(plan(sweep_work.scene(), [depths, other, constant], zipped=True)[0], tmp_path / "zip")
    assert zipped.axes[0].get_xlabel() == "medium.attenuation (1/m)"
    assert len(zipped.axes[0].containers) == 1, "zipped lists make one line"
    assert not zipped.legends
    grid = drawn(plan(sweep_work.scene(), [depths, other, constant])[0], tmp_path / "grid")
    names = [text.get_text() for text in grid.legends[0].get_texts()]
    assert names == ["laser.spot_fwhm 0.001 m", "laser.spot_fwhm 0.002 m", "laser.spot_fwhm 0.003 m"]
