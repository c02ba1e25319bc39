"""The furnace: no surface sends back more than it gets, and all ways of asking it agree."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

from imclab.optics.fresnel import reflectance
from imclab.optics.metals import metal_index
from imclab.optics.surface import Diffuse, Lambertian, Material, Microfacet, paper_equation_8
from imclab.transport import surfaces

WATER = 1.3354
SILVER = metal_index("silver") / WATER
NICKEL = metal_index("nickel") / WATER
MATERIALS: dict[str, Material] = {
    "lambertian": Lambertian(0.3),
    "diffuse": Diffuse(0.9, 1.5 / WATER),
    "mirror": Microfacet(1e-4, SILVER),
    "silver": Microfacet(0.001, SILVER),
    "nickel-0.01": Microfacet(0.01, NICKEL),
    "nickel-0.1": Microfacet(0.1, NICKEL),
    "rough": Microfacet(0.5, NICKEL),
    "roughest": Microfacet(1.0, 1000.0 + 0j),
    "glass": Microfacet(0.3, 1.5 / WATER),
}
ANGLES = (0.0, 30.0, 60.0, 85.0, 89.99)
DRAWS = 200_000


def direction(degrees: float) -> tuple[float, float, float]:
    return math.sin(math.radians(degrees)), 0.0, math.cos(math.radians(degrees))


@numba.njit
def run(surface, w_in, u):
    """Mean weight with its standard error, and the worst disagreement of weight and f cos / density."""
    count = len(u)
    total = squares = worst = 0.0
    for i in range(count):
        w_out, weight = surfaces.sample(surface, w_in, u[i, 0], u[i, 1])
        total += weight
        squares += weight * weight
        if weight > 0.0:
            ratio = (
                surfaces.evaluate(surface, w_in, w_out) * w_out[2] / surfaces.density(surface, w_in, w_out)
            )
            worst = max(worst, abs(ratio / weight - 1.0))
    mean = total / count
    return mean, math.sqrt(max(squares / count - mean * mean, 0.0) / count), worst


@numba.njit
def hostile(surface, u):
    """Count what is not finite or negative over random and grazing pairs of directions."""
    bad = 0
    for i in range(len(u)):
        z = u[i, 0] ** (1 + 8 * (i % 2))  # every other one grazing, down to 1e-40
        radius, turn = math.sqrt(1 - z * z), 2 * math.pi * u[i, 1]
        w_in = (radius * math.cos(turn), radius * math.sin(turn), z)
        u1 = u[i, 2] if i % 7 else 1.0 - 2.0**-53
        w_out, weight = surfaces.sample(surface, w_in, u1, u[i, 3])
        value = surfaces.evaluate(surface, w_in, w_out)
        chance = surfaces.density(surface, w_in, w_out)
        length = w_out[0] ** 2 + w_out[1] ** 2 + w_out[2] ** 2
        good = 0.0 <= weight <= 2.0 and 0.0 <= value < np.inf and 0.0 <= chance < np.inf
        bad += not (good and abs(length - 1.0) < 1e-12)
    return bad


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("name", MATERIALS)
def test_albedo_by_quadrature_equals_albedo_by_sampling_and_is_at_most_one(name: str, degrees: float) -> None:
    material, w_in = MATERIALS[name], direction(degrees)
    albedo = material.directional_albedo(w_in[2])
    mean, error, worst = run(material.parameters, w_in, np.random.default_rng(7).random((DRAWS, 2)))
    assert 0.0 <= albedo <= 1.0
    assert abs(mean - albedo) <= 4.5 * error + 2e-6
    assert worst < 1e-11
    drawn = material.sample(w_in, np.random.default_rng(8).random((DRAWS, 2))).weight
    assert abs(drawn.mean() - albedo) <= 4.5 * drawn.std() / np.sqrt(DRAWS) + 2e-6


def test_furnace_rejects_the_law_as_the_paper_prints_it() -> None:
    """The power partner: eq. 8 taken literally, with a lossless mirror, sends back more than it gets."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    radius, turn = np.meshgrid(0.5 * (1 + nodes), np.pi * (1 + nodes), indexing="ij")
    w_out = np.stack(
        (np.sqrt(radius) * np.cos(turn), np.sqrt(radius) * np.sin(turn), np.sqrt(1 - radius)), -1
    )
    for degrees in (0.0, 70.0):
        values = paper_equation_8(direction(degrees), w_out, index=1000.0)
        albedo = np.sum(np.pi * values * np.outer(weights, weights)) / 4
        assert albedo > 1.2


@pytest.mark.parametrize("name", [name for name in MATERIALS if name != "diffuse"])
def test_reciprocity(name: str) -> None:
    material = MATERIALS[name]
    rng = np.random.default_rng(1)
    for degrees in ANGLES:
        w_in = np.array(direction(degrees))
        w_out = material.sample(w_in, rng.random((500, 2))).w_out
        up = w_out[:, 2] > 0
        there, back = material.evaluate(w_in, w_out[up]), material.evaluate(w_out[up], w_in)
        assert there == pytest.approx(back, rel=1e-12)
        for w in w_out[up][:50]:
            one = surfaces.evaluate(material.parameters, tuple(w_in), tuple(w))
            assert one == pytest.approx(
                surfaces.evaluate(material.parameters, tuple(w), tuple(w_in)), rel=1e-12
            )


def test_the_diffuse_law_is_eq_11_and_reciprocal_only_between_equal_angles() -> None:
    material = MATERIALS["diffuse"]
    w, v = direction(20.0), direction(60.0)
    r = reflectance(w[2], 1.5 / WATER)
    expected = (1 - r) * (1 - r) * 0.9 / (1 - r * 0.9) / np.pi
    assert material.evaluate(w, v) == pytest.approx(expected, rel=1e-13)
    assert surfaces.evaluate(material.parameters, w, v) == pytest.approx(expected, rel=1e-13)
    assert material.evaluate(v, w) != pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("name", MATERIALS)
def test_kernels_follow_the_reference(name: str) -> None:
    material = MATERIALS[name]
    rng = np.random.default_rng(2)
    for degrees in ANGLES:
        w_in = direction(degrees)
        u = rng.random((200, 2))
        drawn = material.sample(w_in, u)
        for (u1, u2), w_out, weight in zip(u, drawn.w_out, drawn.weight, strict=True):
            direction_out, kernel_weight = surfaces.sample(material.parameters, w_in, u1, u2)
            assert direction_out == pytest.approx(w_out, abs=1e-14)
            assert kernel_weight == pytest.approx(weight, rel=1e-10, abs=1e-14)
            value = surfaces.evaluate(material.parameters, w_in, direction_out)
            assert value == pytest.approx(float(material.evaluate(w_in, direction_out)), rel=1e-11)
            chance = surfaces.density(material.parameters, w_in, direction_out)
            assert chance == pytest.approx(float(material.density(w_in, direction_out)), rel=1e-11)


@pytest.mark.parametrize("roughness", [1e-4, 1e-3, 0.1, 1.0])
def test_nothing_is_nan_for_random_and_grazing_directions(roughness: float) -> None:
    u = np.random.default_rng(3).random((300_000, 4))
    for index in (SILVER, NICKEL, 1.12 + 0j):
        assert hostile(Microfacet(roughness, index).parameters, u) == 0


def test_density_integrates_to_one_over_all_directions() -> None:
    """Below the surface too: what is drawn there is lost, not forgotten."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    # Polar angles around -w_in: there the density has a pole that sin(angle) takes away.
    away, turn = np.meshgrid(np.pi / 2 * (1 + nodes), np.pi * (1 + nodes), indexing="ij")
    area = np.outer(weights, weights) * np.sin(away) * np.pi**2 / 2
    for material in (Lambertian(0.5), Microfacet(0.5, NICKEL), Microfacet(1.0, SILVER)):
        for degrees in (0.0, 40.0, 80.0):
            axis = -np.array(direction(degrees))
            across, beside = np.array([-axis[2], 0.0, axis[0]]), np.array([0.0, 1.0, 0.0])
            around = np.cos(turn)[..., None] * across + np.sin(turn)[..., None] * beside
            w_out = np.cos(away)[..., None] * axis + np.sin(away)[..., None] * around
            total = np.sum(material.density(direction(degrees), w_out) * area)
            assert total == pytest.approx(1.0, abs=2e-3)


def test_slopes_have_the_stated_root_mean_square() -> None:
    """Roughness is the root mean square slope: at normal incidence nothing is turned over."""
    drawn = Microfacet(0.01, SILVER).sample((0.0, 0.0, 1.0), np.random.default_rng(3).random((DRAWS, 2)))
    half = drawn.w_out + np.array([0.0, 0.0, 1.0])
    slope_square = (half[:, 0] ** 2 + half[:, 1] ** 2) / half[:, 2] ** 2
    assert np.mean(slope_square) == pytest.approx(0.01**2, rel=4.5 / np.sqrt(DRAWS))
    assert np.std(half[:, 0] / half[:, 2]) == pytest.approx(0.01 / np.sqrt(2), rel=4.5 / np.sqrt(2 * DRAWS))


def test_fresnel_against_the_textbook() -> None:
    assert reflectance(1.0, 1.5) == pytest.approx(0.04, rel=1e-14)
    assert reflectance(0.0, 1.5) == pytest.approx(1.0, rel=1e-14)
    assert reflectance(np.cos(np.arctan(1.5)), 1.5) == pytest.approx(0.5 * ((1.5**2 - 1) / (1.5**2 + 1)) ** 2)
    assert reflectance(0.5, 0.7) == pytest.approx(1.0, abs=1e-15)  # beyond total reflection
    # Against water: the packaged table's own column.
    assert reflectance(1.0, metal_index("silver") / 1.335406) == pytest.approx(0.9789248, abs=1e-6)
    assert reflectance(1.0, metal_index("nickel") / 1.335406) == pytest.approx(0.5549691, abs=1e-6)
    c = np.linspace(0, 1, 101)
    for m in (SILVER, NICKEL, 1.12, 0.3 - 1e-9j):
        root = np.sqrt(complex(m) ** 2 - (1 - c * c) + 0j)
        perpendicular, parallel = (c - root) / (c + root), (m**2 * c - root) / (m**2 * c + root)
        literal = 0.5 * (abs(perpendicular) ** 2 + abs(parallel) ** 2)
        assert reflectance(c, m) == pytest.approx(literal, abs=1e-12)
