"""The interface of phase functions: shapes, refusals, tables kept and read-only."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from imclab.errors import InputError
from imclab.optics import phase
from imclab.optics.phase_table import cell_edges, cell_of


def test_shapes_follow_the_argument() -> None:
    for function in (phase.Isotropic(), phase.HenyeyGreenstein(0.9), phase.petzold(), phase.Mie(3.0, 1.2)):
        assert function.evaluate(0.5).shape == ()
        assert function.evaluate(np.zeros((2, 3))).shape == (2, 3)
        assert function.cdf([0.0, 1.0]).shape == (2,)
        assert function.sample(np.full((4, 1), 0.5)).shape == (4, 1)


def test_samples_grow_with_the_uniform_number() -> None:
    u = np.linspace(0, 1, 1001)
    for function in (
        phase.Rayleigh(),
        phase.HenyeyGreenstein(-0.3),
        phase.FournierForand(),
        phase.Mie(9.0, 1.5),
    ):
        assert np.all(np.diff(function.sample(u)) >= 0)


def test_tables_are_kept_and_read_only() -> None:
    function = phase.HenyeyGreenstein(0.8)
    table = function.table(128)
    assert function.table(128) is table
    assert function.table().density.size == 4096
    for array in table:
        assert not array.flags.writeable
        assert array.flags.c_contiguous
    with pytest.raises(InputError, match="even number"):
        function.table(127)


def test_every_direction_finds_its_cell() -> None:
    edges = cell_edges(512)
    assert edges[0] == 0.0
    assert edges[-1] == 2.0
    assert np.array_equal(cell_of(0.5 * (edges[1:] + edges[:-1]), 512), np.arange(512))
    assert cell_of(2.0, 512) == 511


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: phase.HenyeyGreenstein(1.01), "g: got 1.01; wanted -1 to 1"),
        (lambda: phase.HenyeyGreenstein(float("nan")), "g: got nan"),
        (lambda: phase.TwoTermHenyeyGreenstein(0.9, -0.5, 1.5), "weight: got 1.5; wanted 0 to 1"),
        (lambda: phase.Rayleigh(-0.1), "depolarisation"),
        (lambda: phase.FournierForand(1.0, 3.5), "index: got 1; wanted above 1 to 1.5"),
        (lambda: phase.FournierForand(1.1, 5.5), "slope"),
        (lambda: phase.Mixture((phase.Isotropic(),), (1.0, 2.0)), "2 for 1 components"),
        (lambda: phase.Mixture((phase.Isotropic(),), (0.0,)), "only zeros"),
        (lambda: phase.Mie(3e4, 1.2), "x: got 30000; wanted 1e-08 to 20000"),
        (lambda: phase.Mie(3.0, 1.0), "differs from that of the medium"),
        (lambda: phase.Mie([1.0, 2.0], 1.2, [1.0]), "1 for 2 sizes"),
        (lambda: phase.petzold("AUTEC"), "AUTEC_7"),
        (lambda: phase.Isotropic().evaluate(1.1), "mu: got 1.1"),
        (lambda: phase.Isotropic().sample(-0.1), "u: got -0.1"),
    ],
)
def test_refusals_name_the_allowed_range(make: Callable[[], object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        make()


def test_mixture_is_the_weighted_sum() -> None:
    water, particles = phase.Rayleigh(0.039), phase.HenyeyGreenstein(0.9)
    mixed = phase.Mixture((particles, water), (3.0, 1.0))
    mu = np.linspace(-1, 1, 7)
    assert mixed.evaluate(mu) == pytest.approx(0.75 * particles.evaluate(mu) + 0.25 * water.evaluate(mu))
    assert mixed.asymmetry == pytest.approx(0.75 * 0.9)
    assert mixed.weights == (0.75, 0.25)


def table(angles: list[float], values: list[float], **more: float) -> phase.Tabulated:
    return phase.Tabulated(np.radians(angles), values, **more)


@pytest.mark.parametrize(
    ("angles", "values", "more", "said"),
    [
        (
            [0, 90, 80, 180],
            [3, 1, 1, 1],
            {},
            r"angles\[2\]: got 1.39626 after 1.5708; wanted strictly increasing",
        ),
        ([0, 90, 180], [3, -1, 1], {}, r"values\[1\]: got -1; wanted positive"),
        ([0, 90, 180], [3, float("nan"), 1], {}, r"values\[1\]: got nan"),
        ([1, 2, 180], [100, 10, 1], {}, "slope toward 0 degrees: got -3.32"),
        ([1, 2, 180], [100, 60, 1], {"forward_slope": -2.0}, "slope toward 0 degrees: got -2"),
        ([0, 60, 120], [3, 1, 1], {}, "last angle: got 120 deg; wanted 170 to 180 deg"),
        ([0, 60, 200], [3, 1, 1], {}, "angles: got 3.49"),
        ([0, 180], [3, 1, 1], {}, "two columns of equal length"),
    ],
)
def test_tables_that_are_none(angles: list[float], values: list[float], more: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        table(angles, values, **more)


def test_a_flat_table_is_isotropic_and_its_scale_is_the_integral() -> None:
    flat = table([0, 1, 30, 90, 175], [2.0] * 5)
    assert flat.scale == pytest.approx(8 * np.pi, rel=1e-12)
    assert flat.asymmetry == pytest.approx(0.0, abs=1e-9)
    assert flat.evaluate([-1.0, 0.3, 1.0]) == pytest.approx([0.25 / np.pi] * 3)


def test_a_finely_tabulated_phase_function_comes_back() -> None:
    truth = phase.HenyeyGreenstein(0.9)
    degrees = np.concatenate((np.geomspace(0.01, 1, 200), np.linspace(1.05, 180, 3000)))
    copy = phase.Tabulated(np.radians(degrees), truth.evaluate(np.cos(np.radians(degrees))))
    assert copy.scale == pytest.approx(1.0, rel=1e-5)
    assert copy.asymmetry == pytest.approx(0.9, rel=1e-5)
    assert copy.second_moment == pytest.approx(0.81, rel=1e-5)
