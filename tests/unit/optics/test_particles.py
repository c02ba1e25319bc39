"""Particles in water: eq. 7 both ways, with and without the water itself."""

from __future__ import annotations

import numpy as np
import pytest

from imclab.errors import InputError
from imclab.optics import mie, water
from imclab.optics.particle_readings import Amount, Powder, read
from imclab.optics.particles import Particles, suspension
from imclab.optics.size_distribution import Junge, LogNormal, MeasuredSizes, SingleSize

GREEN = 532e-9


def calcite(index: complex = 1.59 / 1.33, **more) -> Particles:
    return Particles(more.pop("sizes", 3e-6), index, wavelength=GREEN, medium_index=1.33, **more)


@pytest.mark.parametrize(
    ("index", "attenuation", "g", "backward", "phase"),
    [
        (1.59, 0.406, 0.722, 0.0850, 0.0412),
        (1.59 / 1.33, 0.413, 0.861, 0.0471, 0.0218),
        (1.6046 / 1.33, 0.450, 0.871, 0.0434, 0.0198),
    ],
)
def test_one_milligram_of_calcite_in_a_litre(index, attenuation, g, backward, phase) -> None:
    made = suspension(calcite(index), mass_concentration=1e-3)
    assert made.attenuation == pytest.approx(attenuation, abs=1e-3)
    assert made.asymmetry == pytest.approx(g, abs=1e-3)
    assert made.phase_function.backscatter_fraction == pytest.approx(backward, abs=2e-4)
    assert float(made.phase_function.evaluate(-1.0)) == pytest.approx(phase, abs=2e-4)


def test_eq_7_by_hand() -> None:
    powder = calcite()
    q = mie.efficiencies(np.pi * 3e-6 * 1.33 / GREEN, 1.59 / 1.33)
    made = suspension(powder, number_density=1e10)
    assert made.attenuation == pytest.approx(1e10 * q.extinction * np.pi * 1.5e-6**2, rel=1e-12)
    assert made.mass_concentration == pytest.approx(1e10 * 2710 * np.pi / 6 * 3e-6**3, rel=1e-12)


def test_the_ways_to_say_how_much_agree_and_the_water_counts() -> None:
    own = water.pure_water(GREEN)
    made = suspension(calcite(), own, attenuation=0.42)
    assert made.attenuation == pytest.approx(0.42)
    again = suspension(calcite(), own, mass_concentration=made.mass_concentration)
    assert again.number_density == pytest.approx(made.number_density)
    assert suspension(calcite(), own, number_density=made.number_density).attenuation == pytest.approx(0.42)
    bare = suspension(calcite(), attenuation=0.42)
    assert bare.mass_concentration > made.mass_concentration
    assert bare.albedo == pytest.approx(1.0)
    assert made.absorption == pytest.approx(own.absorption)
    assert made.albedo == pytest.approx(1 - own.absorption / 0.42)
    assert made.asymmetry == pytest.approx(
        bare.asymmetry * (made.scattering - own.scattering) / made.scattering
    )


def test_absorbing_particles_absorb() -> None:
    made = suspension(calcite(1.2 - 0.01j), number_density=1e10)
    assert made.absorption > 0
    assert made.absorption + made.scattering == pytest.approx(made.attenuation)


def test_material_index_is_divided_by_the_waters() -> None:
    made = Particles.of_material(3e-6, 1.59, wavelength=GREEN, medium_index=1.33)
    assert made.relative_index == pytest.approx(1.59 / 1.33)


def test_backscatter_of_one_size_is_a_lottery_and_of_many_is_not() -> None:
    def backscatter(medium_index: float, sizes: object) -> float:
        spheres = Particles(sizes, 1.59, wavelength=GREEN, medium_index=medium_index)  # type: ignore[arg-type]
        return float(spheres.phase_function.evaluate(-1.0))

    single = backscatter(1.3371, 6e-6) / backscatter(1.33, 6e-6)
    assert single == pytest.approx(0.454 / 0.112, rel=0.05)
    spread = LogNormal(6e-6, 1.1)
    assert backscatter(1.3371, spread) == pytest.approx(backscatter(1.33, spread), rel=0.1)


def test_size_distributions_have_the_moments_of_their_formulas() -> None:
    d, share = LogNormal(2e-6, 1.5).nodes()
    assert share.sum() == pytest.approx(1)
    for power in (1, 2, 3):
        expected = 2e-6**power * np.exp(0.5 * (power * np.log(1.5)) ** 2)
        assert share @ d**power == pytest.approx(expected, rel=1e-3)
    d, share = Junge(4.0, 1e-6, 1e-4).nodes()
    assert share @ d == pytest.approx(1e-6 * (3 / 2) * (1 - 1e-4) / (1 - 1e-6), rel=1e-4)
    d, share = MeasuredSizes([1e-6, 2e-6, 4e-6], [1.0, 1.0, 1.0]).nodes()
    assert share @ np.log(d) == pytest.approx(np.log(2e-6))
    assert SingleSize(1e-6).nodes()[1] == [1.0]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: SingleSize(0.0), "diameter: got 0"),
        (lambda: LogNormal(1e-6, 1.0), "sigma: got 1; wanted 1.001 to 5"),
        (lambda: Junge(4.0, 2e-6, 1e-6), "largest: got 1e-06 m; wanted more than smallest"),
        (lambda: MeasuredSizes([2e-6, 1e-6], [1.0, 1.0]), "strictly increasing"),
        (lambda: MeasuredSizes([1e-6, 2e-6], [0.0, 0.0]), "only zeros"),
        (lambda: MeasuredSizes([1e-6, 2e-6], [1.0, -1.0]), "numbers: got -1"),
        (lambda: MeasuredSizes([1e-6], [1.0]), "2 rows or more"),
        (lambda: calcite(1.0), "differs from that of the water"),
        (lambda: calcite(density=0.0), "density"),
        (lambda: calcite(sizes=-1.0), "diameter"),
        (lambda: suspension(calcite()), "exactly one"),
        (lambda: suspension(calcite(), number_density=1.0, attenuation=1.0), "exactly one"),
        (lambda: suspension(calcite(), attenuation=0.0), "attenuation: got 0; wanted above 0"),
        (
            lambda: suspension(calcite(), water.pure_water(GREEN), attenuation=0.04),
            "more than the water's own",
        ),
    ],
)
def test_refusals(make, said: str) -> None:
    with pytest.raises(InputError, match=said):
        make()


def test_readings_of_the_papers_powder() -> None:
    readings = read(Powder(3e-6, 1.59, water="none"), Amount(optical_depth=0.42))
    assert [r.name for r in readings] == [
        "absolute index, diameter",
        "relative index, diameter",
        "absolute index, radius",
        "relative index, radius",
    ]
    assert all(r.values["attenuation_per_m"] == pytest.approx(0.42) for r in readings)
    # Radius for diameter: twice the powder, roughly; relative for absolute: hardly more or less.
    grams = [r.values["grams_per_litre"] for r in readings]
    assert 1.5 < grams[2] / grams[0] < 2.2
    assert grams[1] / grams[0] == pytest.approx(1.0, abs=0.05)
    with pytest.raises(InputError, match="fresh, sea, none"):
        read(Powder(3e-6, 1.59, water="salt"), Amount(optical_depth=0.42))
