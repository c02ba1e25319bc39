"""Mie theory: error against the reference values and speed beside miepython, in one run.

``python -m tests.figures.optics_mie`` prints both tables. Speeds are medians of CPU time of
interleaved rounds on one thread, after every program has been compiled; only the ratios count.
"""

from __future__ import annotations

import os

os.environ["MIEPYTHON_USE_JIT"] = "1"  # read by miepython when it is imported

import json
import time
from collections.abc import Callable
from pathlib import Path

import miepython
import numpy as np

from imclab.optics import mie

REFERENCE = Path(__file__).parents[1] / "reference"
FIELDS = ("qext", "qsca", "qabs", "qback", "g")
ROUNDS = 9


def own(x: float, m: complex) -> dict[str, float]:
    found = mie.efficiencies(x, m)
    return dict(zip(FIELDS, found, strict=True))


def peer(x: float, m: complex) -> dict[str, float]:
    extinction, scattering, backscattering, asymmetry = miepython.efficiencies_mx(m, x)
    values = (extinction, scattering, extinction - scattering, backscattering, asymmetry)
    return dict(zip(FIELDS, values, strict=True))


def own_amplitudes(x: float, m: complex, mu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return mie.amplitudes(x, m, mu)


def peer_amplitudes(x: float, m: complex, mu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return miepython.S1_S2(m, x, mu, norm="wiscombe")


def accuracy() -> None:
    cases = json.loads((REFERENCE / "mie_public.json").read_text())["cases"]
    print(f"{len(cases)} spheres of mie_public.json, x from 1e-8 to 1e6")
    print("program     quantity    relative error: median     90 %      max   beyond the file's tolerance")
    for name, solve, angular in (("imclab", own, own_amplitudes), ("miepython", peer, peer_amplitudes)):
        found = [solve(case["x"], complex(case["m_real"], case["m_imag"])) for case in cases]
        for field in FIELDS:
            true = np.array([case[field] for case in cases])
            error = np.abs(np.array([one[field] for one in found]) - true)
            allowed = np.array([_tolerance(case, field) for case in cases])
            used = true != 0
            told = np.percentile(error[used] / np.abs(true[used]), (50, 90, 100))
            print(f"{name:10s}  {field:8s}  {_three(told)}  {np.sum(error > allowed)} of {len(cases)}")
        ratio, error = zip(*(_amplitude_error(case, angular) for case in cases), strict=True)
        told = np.percentile(error, (50, 90, 100))
        print(f"{name:10s}  {'S1, S2':8s}  {_three(told)}  {np.sum(np.array(ratio) > 1)} of {len(cases)}")


def _three(values: np.ndarray) -> str:
    return f"{values[0]:24.1e} {values[1]:8.1e} {values[2]:8.1e}"


def _tolerance(case: dict, field: str) -> float:
    basis = 1e-12 * abs(case[field]) + 60 * case["half_ulp"][field]
    easy = field not in ("g", "qback") or (
        abs(complex(case["m_real"], case["m_imag"]) - 1) > 1e-3 and case["x"] <= 1e4
    )
    return basis if easy else 100 * basis


def _amplitude_error(case: dict, solve: Callable) -> tuple[float, float]:
    """Largest error over its tolerance, and largest error relative to the larger of |S1|, |S2|."""
    m = complex(case["m_real"], case["m_imag"])
    degrees = np.array([angle["theta_deg"] for angle in case["angles"]])
    s1, s2 = solve(case["x"], m, np.cos(np.radians(degrees)))
    worst = largest = 0.0
    for i, angle in enumerate(case["angles"]):
        true = [complex(angle[f"{s}_re"], angle[f"{s}_im"]) for s in ("s1", "s2")]
        size = max(map(abs, true))
        for found, value, key in zip((s1[i], s2[i]), true, ("half_ulp_s1", "half_ulp_s2"), strict=True):
            allowed = 1e-12 + 60 * angle[key] / size
            if degrees[i] not in (0, 180):
                allowed += 3e-16 * case["x"] / np.sin(np.radians(degrees[i]))
            allowed = 1e-7 if abs(m - 1) < 1e-3 else allowed
            error = abs(found - value) / size
            worst, largest = max(worst, error / allowed), max(largest, error)
    return worst, largest


def seconds(work: Callable[[], object], repeat: int) -> float:
    start = time.process_time()
    for _ in range(repeat):
        work()
    return (time.process_time() - start) / repeat


def speed() -> None:
    sizes = 20.0 * np.exp(0.3 * np.random.default_rng(1).standard_normal(10_000))
    mu = np.cos(np.radians(np.linspace(0, 180, 1801)))
    tasks: list[tuple[str, Callable, Callable, int]] = [
        (
            f"one sphere, x = {x:g}, m = {m:g}",
            lambda x=x, m=m: mie.efficiencies(x, m),
            lambda x=x, m=m: miepython.efficiencies_mx(m, x),
            n,
        )
        for x, m, n in (
            (23.6, 1.2, 3000),
            (23.6, 1.2 - 0.01j, 3000),
            (1000.0, 1.2, 300),
            (1000.0, 1.2 - 0.01j, 300),
        )
    ]
    tasks += [
        (
            f"10,000 sizes around 20, m = {m:g}",
            lambda m=m: mie.efficiencies(sizes, m),
            lambda m=m: miepython.efficiencies_mx(m, sizes),
            3,
        )
        for m in (1.2, 1.2 - 0.01j)
    ]
    tasks += [
        (
            f"S1, S2 at 1801 angles, x = {x:g}",
            lambda x=x: mie.amplitudes(x, 1.2, mu),
            lambda x=x: miepython.S1_S2(1.2, x, mu),
            n,
        )
        for x, n in ((23.6, 100), (200.0, 20))
    ]
    print(f"\nCPU time, one thread, medians of {ROUNDS} interleaved rounds")
    for label, ours, theirs, repeat in tasks:
        ours(), theirs()
        rounds = np.array([(seconds(ours, repeat), seconds(theirs, repeat)) for _ in range(ROUNDS)])
        a, b = np.median(rounds, axis=0) * 1e6
        print(
            f"{label:38s} imclab {a:9.1f} us   miepython {b:9.1f} us   "
            f"ratio {np.median(rounds[:, 1] / rounds[:, 0]):5.2f}"
        )


if __name__ == "__main__":
    accuracy()
    speed()
