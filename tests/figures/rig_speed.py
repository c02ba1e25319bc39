"""How long a verified delay and a 200-point scan take on a paced line, and what the wire alone would take.

Run with ``python -m tests.figures.rig_speed``; about a minute, nearly all of it waiting for bytes.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from fractions import Fraction
from statistics import median

import rig


@contextlib.contextmanager
def simulated(model: str, baud: int) -> Iterator[str]:
    """Run a paced simulated generator in a process of its own, and give its address."""
    words = [
        sys.executable,
        "-m",
        "imclab",
        "gate",
        "simulate",
        "--model",
        model,
        "--baud",
        str(baud),
        "--json",
    ]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield json.loads(process.stdout.readline())["url"]
        process.terminate()


def wire_seconds(sent: int, received: int, baud: int) -> float:
    """Time that the bytes of one exchange need, one direction after the other."""
    return (sent + received) * 10 / baud


def verified_set(model: str, baud: int) -> tuple[float, float]:
    """Median seconds of a verified delay, and the wire's share."""
    seconds = []
    with (
        simulated(model, baud) as url,
        rig.open_generator(url, model=model, baud=baud) as box,
    ):
        step = box.dialect.model.step_ps
        box.apply(rig.plan_gate("40 m", model=model))
        for index in range(20):
            begin = time.perf_counter()
            box.set("delay", Fraction(400_000 + index * step, 10**12))
            seconds.append(time.perf_counter() - begin)
        sent = box.conversation.journal.sent[-2:] if model == "bnc575" else box.conversation.journal.sent[-1:]
    replies = {"dg645": "0\r\n0,+0.000000400000\r\n", "bnc575": "ok\r\n0.00000040000\r\n"}[model]
    return median(seconds), wire_seconds(len(b"".join(sent)), len(replies), baud)


def scan_of_200(model: str, baud: int, *, grab: bool) -> float:
    """Seconds of a 200-point verified scan, with the triggers stopped and started at each point or not."""
    limits = rig.limits.read_limits(
        {
            "model": model,
            "serial": {"dg645": "004025", "bnc575": "02311"}[model],
            "max_width": "1 us",
            "earliest_opening": "0 ns",
            "max_rate": "1 kHz",
            "max_duty": 1,
            "max_amplitude": "5 V",
            "polarities": ["positive"],
            "triggers": ["external rising"],
        }
    )
    plan = rig.plan_gate("40 m", model=model)
    sweep = rig.plan_scan(plan, start="38 m", stop="42 m", points=200)
    with (
        simulated(model, baud) as url,
        rig.open_generator(url, model=model, baud=baud, limits=limits) as box,
    ):
        begin = time.perf_counter()
        steps = list(rig.run_scan(box, sweep, grab=(lambda step: 1.0) if grab else None))
        taken = time.perf_counter() - begin
    assert [step.read_ps for step in steps] == list(sweep.delays_ps)
    return taken


def main() -> None:
    """Print the table."""
    print("model   baud    verified set  wire      ratio  200 points  200 points with a frame each")
    for model, baud in (("dg645", 9600), ("dg645", 115200), ("bnc575", 9600), ("bnc575", 115200)):
        taken, wire = verified_set(model, baud)
        bare, framed = (scan_of_200(model, baud, grab=grab) for grab in (False, True))
        print(
            f"{model:<7} {baud:<7} {taken * 1e3:8.1f} ms  {wire * 1e3:6.1f} ms  {taken / wire:5.2f}  "
            f"{bare:8.2f} s  {framed:8.2f} s"
        )


if __name__ == "__main__":
    main()
