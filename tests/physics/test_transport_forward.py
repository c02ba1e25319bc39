"""The forward engine against what is known: slabs to ten digits, single scattering, Beer and Lambert."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imclab.optics import phase
from imclab.transport.setup import Beam
from tests import judging
from tests.one_way import slab
from tests.oracles_transport import forward_histories

REFERENCE = Path(__file__).parents[1] / "reference"
SLABS = json.loads((REFERENCE / "slab_index_matched.json").read_text(encoding="utf-8"))["cases"]
LITERATURE = json.loads((REFERENCE / "rt_literature.json").read_text(encoding="utf-8"))
DEGREES = 31.0


def compared(case: dict[str, Any], outcome: Any) -> list[float]:
    """Z of transmittance, reflectance and both mean paths."""
    truths = (
        (outcome.transmitted, case["T_total"]),
        (outcome.reflected, case["R_total"]),
        (outcome.transmitted_path, case["mean_path_T_over_d"]),
        (outcome.reflected_path, case["mean_path_R_over_d"]),
    )
    return [float(judging.z_of(value[0], stderr[0], truth)) for (value, stderr), truth in truths]


def test_slabs_agree_with_the_discretised_transfer_equation() -> None:
    z = [
        compared(case, slab(case["tau"], case["albedo"], float(case["g"]), packets=100_000)) for case in SLABS
    ]
    assert not judging.reject(z, degrees=DEGREES), np.round(z, 1)


@pytest.mark.parametrize(("albedo_factor", "g_shift"), [(0.98, 0.0), (1.0, 0.02)])
def test_slabs_of_a_slightly_wrong_water_are_rejected(albedo_factor: float, g_shift: float) -> None:
    cases = [case for case in SLABS if case["tau"] == 2.0 and case["g"] in (0.5, 0.75)]
    z = [
        compared(case, slab(2.0, case["albedo"] * albedo_factor, case["g"] + g_shift, packets=200_000))
        for case in cases
    ]
    assert judging.reject(z, degrees=DEGREES)


def test_a_table_gives_what_its_closed_form_gives() -> None:
    table = phase.HenyeyGreenstein(0.924).table()
    closed = slab(4.0, 0.89, 0.924, packets=400_000)
    tabulated = slab(4.0, 0.89, table, packets=400_000, seed=2)
    z = [judging.z_of(a[0], a[1], b[0], b[1]) for a, b in zip(closed[:6], tabulated[:6], strict=True)]
    assert not judging.reject(z, degrees=DEGREES)
    wrong = slab(4.0, 0.89, phase.HenyeyGreenstein(0.904).table(), packets=400_000, seed=2)
    assert judging.reject([judging.z_of(*closed[k], *wrong[k]) for k in range(6)], degrees=DEGREES)


def test_several_planes_in_one_run_agree_with_one_run_each() -> None:
    planes = (0.25, 0.5, 1.0)
    together = slab(5.0, 0.95, 0.8, packets=400_000, planes=planes)
    for k, distance in enumerate(planes):
        alone = slab(5.0, 0.95, 0.8, packets=400_000, planes=(distance,), seed=k + 7)
        z = [
            judging.z_of(together[q][0][k], together[q][1][k], alone[q][0][0], alone[q][1][0])
            for q in range(4)
        ]
        assert not judging.reject(z, degrees=DEGREES), z


@pytest.mark.parametrize("optical_depth", [0.0, 0.42, 1.42, 30.0])
def test_without_scattering_the_law_of_beer_and_lambert_is_exact(optical_depth: float) -> None:
    outcome = slab(optical_depth, 0.0, 0.924, packets=100)
    assert outcome.transmitted[0][0] == pytest.approx(math.exp(-optical_depth), rel=1e-12)
    assert outcome.transmitted[1][0] == 0.0
    assert outcome.reflected[0][0] == 0.0


@pytest.mark.parametrize("case", LITERATURE["single_scattering"]["values"][::2])
def test_weak_scattering_is_single_scattering(case: dict[str, float]) -> None:
    albedo = 1e-6
    outcome = slab(case["tau"], albedo, float(case["g"]), packets=round(2e5 / albedo))
    unscattered = math.exp(-case["tau"])
    z = [
        judging.z_of(
            (outcome.transmitted[0] - unscattered) / albedo, outcome.transmitted[1] / albedo, case["T1"]
        ),
        judging.z_of(outcome.reflected[0] / albedo, outcome.reflected[1] / albedo, case["R1"]),
    ]
    assert not judging.reject(z, degrees=DEGREES), z
    shifted = judging.z_of(
        (outcome.transmitted[0] - unscattered) / albedo, outcome.transmitted[1] / albedo, 1.05 * case["T1"]
    )
    assert judging.reject(shifted, degrees=DEGREES)


@pytest.mark.parametrize(
    ("attenuation", "albedo", "asymmetry"),
    [(0.42, 0.89, 0.924), (10.0, 0.89, 0.924), (8.0, 1.0, 0.0), (3.0, 0.2, -0.9), (30.0, 0.99, 0.99)],
)
def test_energy_is_neither_made_nor_lost(attenuation: float, albedo: float, asymmetry: float) -> None:
    outcome = slab(attenuation, albedo, asymmetry, packets=50_000, beam=Beam(1e-3, 0.085))
    whole = outcome.transmitted[0][-1] + outcome.reflected[0][-1] + outcome.absorbed[0][0]
    assert whole == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("attenuation", [0.42, 1.42, 10.0])
def test_lanes_agree_with_one_history_after_another(attenuation: float) -> None:
    beam = Beam(4e-4, 0.085)
    count, batches = 5_000, 32
    rows = np.zeros((batches, 8))
    for k, row in enumerate(rows):
        forward_histories((attenuation, 0.89, 0.924), beam, 1.0, count, k, row)
    mean, stderr = rows.mean(axis=0) / count, rows.std(axis=0, ddof=1) / math.sqrt(batches) / count
    outcome = slab(attenuation, 0.89, 0.924, packets=600_000, beam=beam)
    z = [
        judging.z_of(*outcome.transmitted, mean[0], stderr[0])[0],
        judging.z_of(*outcome.reflected, mean[4], stderr[4])[0],
        judging.z_of(
            outcome.transmitted[0] * outcome.mean_square_radius[0],
            outcome.transmitted[0] * outcome.mean_square_radius[1],
            mean[1],
            stderr[1],
        )[0],
    ]
    assert not judging.reject(z, degrees=DEGREES), z


@pytest.mark.parametrize("asymmetry", [0.0, 1.0, -1.0, 0.9999, -0.9999])
def test_extreme_asymmetries(asymmetry: float) -> None:
    outcome = slab(3.0, 1.0, asymmetry, packets=20_000)
    whole = outcome.transmitted[0][0] + outcome.reflected[0][0]
    assert whole == pytest.approx(1.0, abs=1e-6)
    if asymmetry == 1.0:
        assert outcome.transmitted[0][0] == pytest.approx(1.0, abs=1e-6)
    if asymmetry == -1.0:
        # light that runs forth and back on one line: R = tau / (1 + tau), as two streams
        assert not judging.reject(judging.z_of(*outcome.reflected, 3.0 / 4.0), degrees=DEGREES)


def test_a_packet_of_ten_thousand_collisions_still_has_a_unit_direction() -> None:
    outcome = slab(300.0, 1.0, 0.0, packets=300)
    # diffusion: transmittance (1 + 0.7104) / (300 + 1.4209) of an isotropically scattering slab
    truth = (1.0 + 0.7104) / (300.0 + 2 * 0.7104)
    assert abs(outcome.transmitted[0][0] - truth) < 4.0 * math.sqrt(truth / 300)
    assert outcome.transmitted[0][0] + outcome.reflected[0][0] == pytest.approx(1.0, abs=1e-6)


def test_reflectance_of_an_optically_deep_slab_needs_no_unscattered_light() -> None:
    outcome = slab(30.0, 0.9, 0.0, packets=200_000)
    # Giovanelli's half space without a surface: H-function value from the slab of tau 8 is 0.41484
    truth = next(c for c in SLABS if c["g"] == 0.0 and c["albedo"] == 0.9 and c["tau"] == 8.0)
    assert outcome.reflected[0][0] == pytest.approx(truth["R_total"], abs=0.005)
    assert 0.0 < outcome.transmitted[0][0] < 1e-5
