"""Phase tables: speed of the sampler, error of the table, agreement of 1e8 draws with the coefficients.

``python -m tests.figures.optics_phase [draws]`` prints three tables.
"""

from __future__ import annotations

import sys
import time

import numba
import numpy as np

from imclab.optics import phase
from imclab.transport import phase_sampling


@numba.njit(nogil=True)
def mean_of_draws(table, count, seed, narrow, wide):
    """Sums over draws: s, s squared, and how many lie within two limits of s.

    The numbers are numba's own: making them is part of the figure.
    """
    np.random.seed(seed)  # noqa: NPY002
    total = squares = 0.0
    inside_narrow = inside_wide = 0
    for _ in range(count):
        s = phase_sampling.sample(table, np.random.random())  # noqa: NPY002
        total += s
        squares += s * s
        inside_narrow += s <= narrow
        inside_wide += s <= wide
    return total, squares, inside_narrow, inside_wide


@numba.njit(nogil=True)
def only_uniform_numbers(count):
    total = 0.0
    for _ in range(count):
        total += np.random.random()  # noqa: NPY002
    return total


def within(degrees: float) -> float:
    return float(2 * np.sin(np.radians(degrees) / 2) ** 2)


def speed() -> None:
    print("sampler, ns a draw with its uniform number, median of 7 rounds of 1e7, one thread")
    for name, function in (
        ("Henyey-Greenstein 0.924", phase.HenyeyGreenstein(0.924)),
        ("Mie x = 24", phase.Mie(24.0, 1.2)),
        ("Mie x = 2000", phase.Mie(2000.0, 1.2)),
    ):
        table = function.table()
        mean_of_draws(table, 10, 1, 0.0, 0.0), only_uniform_numbers(10)
        rounds = []
        for _ in range(7):
            start = time.process_time()
            mean_of_draws(table, 10_000_000, 1, 0.0, 0.0)
            middle = time.process_time()
            only_uniform_numbers(10_000_000)
            rounds.append(((middle - start) * 100, (time.process_time() - middle) * 100))
        draw, uniform = np.median(rounds, axis=0)
        print(
            f"  {name:24s} {table.density.size:6d} cells   {draw:5.1f} ns, "
            f"of which the uniform number {uniform:4.1f} ns"
        )


def tables() -> None:
    print("\nerror of the table: asymmetry, <P2>, and P(theta > 179 deg) relative")
    for x in (1.2, 24.0, 200.0, 2000.0):
        function = phase.Mie(x, 1.2)
        table = function.table()
        glory = within(1.0)
        true = float(function.backward_probability(np.array([glory]))[0])
        found = 1 - np.interp(2 - glory, table.edges, table.cumulative)
        print(
            f"  Mie x = {x:<6g} {table.density.size:6d} cells   "
            f"g {table.asymmetry - function.asymmetry:+.1e}   "
            f"P2 {table.second_moment - function.second_moment:+.1e}   glory {found / true - 1:+.1e}"
        )


def draws(count: int) -> None:
    print(f"\n{count:.0e} draws against the coefficients, deviations in standard errors")
    cases = {
        "HG 0.924": phase.HenyeyGreenstein(0.924),
        "Mie x = 23.6, m = 1.19": phase.Mie(23.6, 1.19),
        "Mie x = 200, m = 1.59": phase.Mie(200.0, 1.59),
        "Mie x = 2000, m = 1.2": phase.Mie(2000.0, 1.2),
        "Fournier-Forand": phase.FournierForand(),
        "Petzold average": phase.petzold(),
    }
    for seed, (name, function) in enumerate(cases.items(), start=11):
        sums = mean_of_draws(function.table(), count, seed, within(0.1), within(1.0))
        total, squares, narrow, wide = sums
        mean = total / count
        error = np.sqrt((squares / count - mean**2) / count)
        told = [f"g {1 - mean:.7f} ({(1 - mean - function.asymmetry) / error:+.1f})"]
        for degrees, inside in ((1.0, wide), (0.1, narrow)):
            true = float(function.forward_probability(np.array([within(degrees)]))[0])
            error = np.sqrt(true * (1 - true) / count)
            told.append(
                f"within {degrees:g} deg {inside / count:.4e} ({(inside / count - true) / error:+.1f})"
            )
        print(f"  {name:24s} {'   '.join(told)}")


if __name__ == "__main__":
    speed()
    tables()
    draws(int(float(sys.argv[1])) if len(sys.argv) > 1 else 100_000_000)
