"""Every fault against every job, on both families: what was right, recovered or reported.

Run with ``python -m tests.figures.rig_faults``; a wrong value in silence stops it. The first part runs
in this process on a virtual clock, four seeds of each case; the second over TCP in real time.
"""

from __future__ import annotations

import warnings
from collections import Counter

import rig
import rig.safe_state
from rig.simulator import FAULTS
from tests.unit.rig.bad_line import generous_limits
from tests.unit.rig.test_faults import JOBS, MODELS, outcomes_of

SEEDS = 4
KINDS = ("right", "recovered", "reported")


def in_this_process() -> None:
    """Print one row per fault; each job's count of the three good ends."""
    rig.safe_state._BETWEEN_ATTEMPTS_S = 0.0
    total: Counter[str] = Counter()
    print(f"{'fault':<24}" + "".join(f"{job:>24}" for job in JOBS) + "   (right/recovered/reported)")
    for fault in FAULTS:
        cells = []
        for job in JOBS:
            counts: Counter[str] = Counter()
            for model in MODELS:
                for told, number in outcomes_of(model, job, fault, seeds=SEEDS).items():
                    counts[told.split(",")[0]] += number
            total += counts
            cells.append("/".join(str(counts[kind]) for kind in KINDS))
        print(f"{fault:<24}" + "".join(f"{cell:>24}" for cell in cells))
    print(f"all {sum(total.values())} cases: " + ", ".join(f"{total[kind]} {kind}" for kind in KINDS))


def over_tcp() -> None:
    """Strike once with every fault at a set and at a read, in real time."""
    total: Counter[str] = Counter()
    for fault in FAULTS:
        for job in ("set", "read"):
            with rig.simulate("dg645", seed=1) as simulated:
                limits = generous_limits("dg645")
                told = "right"
                try:
                    with rig.open_generator(simulated.url, limits=limits, timeout="0.2 s") as box:
                        simulated.faults.start(fault, argument=0.6)
                        read = box.set("delay", "445.32 ns").read if job == "set" else box.read("delay")
                        simulated.faults.clear()
                        truth = simulated.device.feed("DLAY?2")
                        assert truth == f"0,+{read / 1e12:.12f}", (fault, job, truth, read)
                        told = "recovered" if box.conversation.recoveries else "right"
                except rig.RigError:
                    told = "reported"
                total[told] += 1
    print(f"over TCP, {sum(total.values())} cases: " + ", ".join(f"{total[kind]} {kind}" for kind in KINDS))


if __name__ == "__main__":
    warnings.simplefilter("error")
    in_this_process()
    over_tcp()
