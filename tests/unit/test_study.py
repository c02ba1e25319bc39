"""Studies: their files, and that their statements are judged by the numbers, both ways."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imclab.errors import InputError
from imclab.result import Flux, Result
from imclab.study import broadening, echo, energy, load_study, pictures
from imclab.study.conclusion import Conclusion
from imclab.study.curves import Point
from imclab.study.file import Study, studies_in
from imclab.study.picture_statements import figure_pixels
from imclab.study.ratios import difference, ratio, shown
from imclab.uncertainty import Estimate

STUDIES = Path(__file__).parents[2] / "data/studies"


def flux(study: Study, index: int, *, spot_matters: bool, pulse_spread: float = 0.0) -> Flux:
    laser = study.units[index].scene.laser
    distance = np.array(study.distances)
    far = distance / distance[-1]
    width = laser.divergence_fwhm * distance * (1 - far) + 3.0 * far * (1 + 2 * laser.divergence_fwhm**2)
    width = width + (100 * laser.spot_fwhm if spot_matters else 0.0)
    pulse = 4.5e-9 * (1 + distance / 30) * (1 + pulse_spread * laser.divergence_fwhm)
    values = {"transmitted": np.exp(-distance), "spot_fwhm": width, "spot_rms": width, "pulse_fwhm": pulse}
    names = ("reflected", "pulse_rms", "mean_path")
    values |= dict.fromkeys(names, np.ones_like(distance))
    rest: dict[str, Any] = {"reflected_mean_path": 1.0, "reflected_mean_path_stderr": 0.0, "absorbed": 0.0}
    rest |= {"absorbed_stderr": 0.0}
    known = Flux.__dataclass_fields__
    return Flux(
        distances=distance,
        **values,
        **{f"{name}_stderr": 1e-4 * value for name, value in values.items()},
        **{
            name: (np.full_like(distance, value) if "path" in name else value)
            for name, value in rest.items()
            if name in known
        },
        scene="",
        seed=1,
        packets=1,
        cpu_seconds=1.0,
        wall_seconds=1.0,
    )


def picture(total: float, backscatter: float, *, relative: float = 1e-3, image: Any = None) -> Result:
    image = np.full((4, 4), total / 16) if image is None else image
    target = total - backscatter
    shares = {"energy": 1.0, "target": target / total, "backscatter": backscatter / total}
    times = np.linspace(0, 1e-8, 5)
    return Result(
        **{name: image * share for name, share in shares.items()},
        **{f"{name}_stderr": 1e-3 * image * share for name, share in shares.items()},
        total=total,
        total_stderr=relative * total,
        target_total=target,
        target_total_stderr=relative * target,
        backscatter_total=backscatter,
        backscatter_total_stderr=relative * backscatter,
        time_edges=times,
        time_energy=np.ones(4) * total,
        time_stderr=np.ones(4) * total * relative,
        scene="",
        estimator="made up",
        seed=1,
        packets=1,
        cpu_seconds=1.0,
        wall_seconds=1.0,
    )


def verdicts(conclusion: Conclusion, beginning: str) -> list[bool]:
    found = [s.true for s in conclusion.statements if s.text.startswith(beginning)]
    assert found, beginning
    return found


@pytest.mark.parametrize("path", studies_in(STUDIES), ids=lambda path: path.stem)
def test_shipped_studies_load_and_every_unit_has_a_seed_of_its_own(path: Path) -> None:
    study = load_study(path)
    seeds = [unit.scene.run.seed for unit in study.units]
    assert len(set(seeds)) == len(seeds) == len(study.curve) * study.points


def test_a_fault_in_a_curve_is_told_with_its_place(tmp_path: Path) -> None:
    text = (STUDIES / "fig8_energy.toml").read_text(encoding="utf-8").replace("../", f"{STUDIES.parent}/")
    (tmp_path / "a.toml").write_text(text.replace("receiver.position", "receiver.positon"), encoding="utf-8")
    with pytest.raises(InputError, match=r"curve diver, 20 cm aside(.|\n)*Did you mean \"position\""):
        load_study(tmp_path / "a.toml")
    with pytest.raises(InputError, match=r"no \*\.toml file"):
        studies_in(tmp_path / "nowhere")


@pytest.mark.parametrize("spot_matters", [False, True])
def test_finding_on_the_radius(spot_matters: bool) -> None:
    study = load_study(STUDIES / "fig2_broadening.toml")
    records = [flux(study, i, spot_matters=spot_matters) for i in range(len(study.units))]
    conclusion = broadening.conclude(study, records)
    assert verdicts(conclusion, "The initial radius") == [not spot_matters] * 2
    assert len(conclusion.rows) == len(study.units) * len(study.distances)


@pytest.mark.parametrize(
    ("spread", "less", "unseen"), [(0.0, True, True), (0.2, True, False), (20.0, False, False)]
)
def test_findings_on_the_pulse(spread: float, less: bool, unseen: bool) -> None:
    study = load_study(STUDIES / "fig2_broadening.toml")
    units = range(len(study.units))
    conclusion = broadening.conclude(
        study, [flux(study, i, spot_matters=False, pulse_spread=spread) for i in units]
    )
    assert verdicts(conclusion, "Divergence and initial radius affect the pulse's width less") == [less]
    assert verdicts(conclusion, "Their effect on the pulse's width is too small") == [unseen]


@pytest.mark.parametrize(("at_end", "alike"), [(1.005, True), (1.5, True), (4.0, False)])
def test_finding_on_the_divergence(at_end: float, alike: bool) -> None:
    """Narrow beams become alike when they end nearer than they began, or within a line's width."""
    study = load_study(STUDIES / "fig2_broadening.toml")
    records = []
    for unit in study.units:
        start = unit.scene.laser.divergence_fwhm / 0.02
        end = {1.0: 1.0, 3.0: at_end, 5.0: 2.0, 10.0: 5.0}[round(start, 3)]
        far = np.linspace(0.0, 1.0, len(study.distances))
        width = start * (1 - far) + end * far
        made = flux(study, unit.index, spot_matters=False)
        records.append(replace(made, spot_fwhm=width, spot_fwhm_stderr=1e-4 * width))
    found = broadening.conclude(study, records).statements
    assert [s.true for s in found if s.text.startswith("The divergence") and "fwhm" in s.text] == [alike]


@pytest.mark.parametrize("below", [True, False])
def test_finding_on_the_camera_aside(below: bool) -> None:
    study = load_study(STUDIES / "fig8_energy.toml")
    records = []
    for unit in study.units:
        aside = any(unit.scene.receiver.position)
        depth = unit.scene.medium.attenuation or 0.0
        path = 2.1 if below and aside else 2.0
        records.append(picture(float(np.exp(-path * depth)), 1e-3))
    conclusion = energy.conclude(study, records)
    assert verdicts(conclusion, "The energy falls") == [True]
    assert verdicts(conclusion, "The coaxial simulation") == [below] * 2


def test_energy_that_does_not_fall_is_noticed() -> None:
    study = load_study(STUDIES / "fig8_energy.toml")
    conclusion = energy.conclude(study, [picture(1.0, 1e-3) for _ in study.units])
    assert verdicts(conclusion, "The energy falls") == [False]


@pytest.mark.parametrize(("left", "removed"), [(0.001, True), (0.5, False)])
def test_finding_on_the_gate_and_backscatter(left: float, removed: bool) -> None:
    study = load_study(STUDIES / "fig3_echo.toml")
    backscatter = {
        "not gated": (0.1, 0.4),
        "not gated, black target": (0.1, 0.4),
        "gated": (0.1 * left, 0.4 * left),
    }
    records = [
        picture(1.0, backscatter[curve.name][depth]) for curve in study.curve for depth in range(study.points)
    ]
    assert verdicts(echo.conclude(study, records), "The gate takes away") == [removed]


def slit(brightness: float, veil: float) -> np.ndarray:
    image = np.full((60, 60), veil)
    image[15:45, 20:40] += brightness
    return image * 1e-13


@pytest.mark.parametrize("gate_helps", [True, False])
def test_finding_on_gating_and_quality(gate_helps: bool) -> None:
    study = load_study(STUDIES / "fig4_table1.toml")
    records = []
    for unit in study.units:
        clear = unit.scene.medium.attenuation == 0.42
        veil = 0.0 if clear or (unit.scene.gate is not None) == gate_helps else 0.8
        records.append(picture(1.0, 0.01, image=slit(1.0 if clear else 0.8, veil)))
    conclusion = pictures.conclude(study, records)
    assert verdicts(conclusion, "Gating raises") == [gate_helps] * 8
    own = verdicts(conclusion, "By the paper's own table")
    assert own == [False, False], "SSIM comes nearer to the experiment's, PSNR goes away from it"
    assert {row["source"] for row in conclusion.rows} >= {"paper: experiment", "paper: simulation, gated"}


@pytest.mark.parametrize(
    ("rough", "verdict"), [(0.3, [False, True]), (1.5, [False, False]), (0.899, [False, False])]
)
def test_finding_on_roughness(rough: float, verdict: list[bool]) -> None:
    """Equal brightness is no fall, nor is a fall within the errors; a real one is."""
    study = load_study(STUDIES / "fig7_table2.toml")
    brightness = {0.001: 0.9, 0.01: 0.9, 0.1: rough}
    records = []
    for unit in study.units:
        figure = figure_pixels(_point(unit.scene, np.zeros((60, 60))))
        light = brightness[unit.scene.target.figure.roughness]  # type: ignore[union-attr]
        record = picture(1.0, 0.01, image=(0.05 + light * figure) * 1e-13)
        records.append(replace(record, seed=unit.index))
    conclusion = pictures.conclude(study, records)
    assert verdicts(conclusion, "Roughness lowers") == verdict * 2


@pytest.mark.parametrize("blurred", [True, False])
def test_finding_on_mssim(blurred: bool) -> None:
    """A darker copy keeps its structure, so MSSIM stays above SSIM; one with other details does not."""
    study = load_study(STUDIES / "fig7_table2.toml")
    noise = np.random.default_rng(1).random((60, 60))
    records = []
    for unit in study.units:
        rough = unit.scene.target.figure.roughness == 0.1  # type: ignore[union-attr]
        image = slit(0.3, 0.0) if rough and blurred else slit(1.0, 0.0)
        image = image + (1e-13 * noise if rough and not blurred else 0.0)
        records.append(replace(picture(1.0, 0.01, image=image), seed=unit.index))
    found = pictures.conclude(study, records).statements
    assert [s.true for s in found if s.text == "MSSIM lies above SSIM (same gain)."] == [blurred]


def _point(scene: Any, image: Any) -> Any:
    return Point(scene, "", replace(picture(1.0, 0.01), energy=image))


def test_ratios_of_independent_estimates() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.normal(2.0, 0.02, 200_000), rng.normal(4.0, 0.08, 200_000)
    found = ratio(Estimate(2.0, 0.02), Estimate(4.0, 0.08))
    assert found.stderr == pytest.approx(np.std(a / b), rel=0.02)
    assert difference(Estimate(2.0, 0.03), Estimate(1.0, 0.04)) == Estimate(1.0, pytest.approx(0.05))
    assert shown(Estimate(0.12345, 0.0012)) == "0.1235 ± 0.0012"
