"""`imclab bench`: it validates, then times, and leaves table, JSON and plot."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from imclab.bench import BenchOptions, WrongKernelError, bench
from imclab.bench.measure import Run, summary
from imclab.bench.scenes import slab_scene, target_scene
from imclab.bench.validate import Check, forward_checks, refuse_wrong
from imclab.bench.write import table, write
from imclab.cli import run as imclab_command


def made_up_run(seconds: float, error: float, *, seed: int = 1, true: float | None = None) -> Run:
    difference = error if true is None else true
    return Run(
        scene="s",
        estimator="e",
        seed=seed,
        packets=round(1e6 * seconds),
        cpu_seconds=seconds,
        wall_seconds=seconds,
        z_total=difference / error,
        own_error=error,
        total_true=difference,
        total_stated=error,
        median_pixel_true=10 * difference,
        median_pixel_stated=10 * error,
        rms_pixel_true=20 * difference,
        rms_pixel_stated=20 * error,
    )


def test_summary_of_a_perfect_estimator() -> None:
    runs = [made_up_run(t, 0.01 / math.sqrt(t)) for t in (0.25, 0.5, 1.0, 2.0)]
    found = summary(runs)
    assert found["total"]["figure_of_merit"] == pytest.approx(1e4)
    assert found["total"]["cpu_seconds_to_1_percent"] == pytest.approx(1.0)
    assert found["median_pixel"]["cpu_seconds_to_1_percent"] == pytest.approx(100.0)
    assert found["total"]["slope"] == pytest.approx(-0.5)
    assert found["total"]["true_over_stated"] == pytest.approx(1.0)
    assert found["packets_per_cpu_second"] == pytest.approx(1e6)


def test_runs_that_rest_on_few_arrivals_count_for_nothing() -> None:
    found = summary([made_up_run(1.0, 0.5)])
    assert math.isnan(found["total"]["cpu_seconds_to_1_percent"])


def test_a_wrong_kernel_is_refused() -> None:
    refuse_wrong(forward_checks(1))
    with pytest.raises(WrongKernelError, match=r"slab, transmitted: \+7.0 standard errors"):
        refuse_wrong([Check("slab, transmitted", 7.0), Check("slab, reflected", 1.0)])
    with pytest.raises(WrongKernelError):
        refuse_wrong([Check("no number", math.nan)])


def test_a_small_bench_from_measurement_to_files(tmp_path: Path) -> None:
    scene = target_scene().with_(**{"receiver.pixels": [10, 10], "receiver.aperture_radius": "25 cm"})
    options = BenchOptions(
        seconds=0.2, reference_seconds=1.0, seeds=1, optical_depths=(0.42,), pixels=(5, 10)
    )
    told: list[str] = []
    measured = bench({"wide aperture": scene}, options, progress=told.append)
    names = {row["estimator"] for row in measured.estimators}
    assert {"analog", "two-sided", "auto"} <= names
    assert all(row["packets_per_cpu_second"] > 0 for row in measured.estimators)
    assert len(measured.threads) == 2
    assert [row["pixels"] for row in measured.pixels] == [5.0, 10.0]
    files = write(measured, tmp_path)
    document = json.loads(files[0].read_text(encoding="utf-8"))
    assert document["options"]["seconds"] == 0.2
    assert "| wide aperture | two-sided |" in files[1].read_text(encoding="utf-8")
    assert files[2].stat().st_size > 10_000
    assert "wide aperture: reference" in told
    assert table(measured).startswith("# Speed against error")


def test_mistakes_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert imclab_command(["bench", "none.toml", "-o", str(tmp_path / "b")]) == 2
    assert "none.toml" in capsys.readouterr().err
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").write_text("x")
    assert imclab_command(["bench", "-o", str(tmp_path / "full")]) == 2


def test_the_slab_of_the_validation_is_the_published_one() -> None:
    scene = slab_scene(2.0, albedo=0.9, asymmetry=0.75)
    assert scene.medium.attenuation == 2.0
    assert np.isclose(scene.laser.divergence_fwhm, 1e-6)
