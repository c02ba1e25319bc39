"""One way through a slab by OpenCL; ``peers_one_way`` runs this file with an interpreter that has it.

Two programs, each in a process of its own because they disturb each other's driver: ``mcx`` is MCX-CL
(package ``pmcxcl``), ``loop`` is ``slab_loop.cl``, a loop in the manner of PyXOpto (``pyopencl``).
"""

from __future__ import annotations

import json
import os
import resource
import sys
from pathlib import Path
from typing import Any

import numpy as np

ITEMS = 256
OPTIONS = ["-cl-fast-relaxed-math", "-cl-mad-enable"]
VOXELS_THROUGH, VOXELS_ACROSS = 2, 41
"""MCX-CL wants two voxels through the slab at least; the fewer, the fewer walls it stops at."""
DARK = {"isreflect": 0, "isnormalized": 0, "issrcfrom0": 1, "autopilot": 1, "outputtype": "energy"}


class Loop:
    """The loop of ``slab_loop.cl``, compiled once for each kind of absorption."""

    def __init__(self) -> None:
        import pyopencl

        # The first platform of an installed driver: others may come with packages of Python.
        device = pyopencl.get_platforms()[0].get_devices()[0]
        self.context = pyopencl.Context([device])
        self.queue = pyopencl.CommandQueue(self.context)
        self.cl = pyopencl
        self.versions = {"pyopencl": pyopencl.VERSION_TEXT, "driver": device.platform.version}
        source = Path(__file__).with_name("slab_loop.cl").read_text(encoding="utf-8")
        self.kernels = {
            name: pyopencl.Kernel(pyopencl.Program(self.context, source).build([*OPTIONS, *more]), "slab")
            for name, more in (("at collisions", []), ("along the path", ["-DALONG_THE_PATH"]))
        }

    def __call__(self, job: dict[str, Any], packets: int, seed: int, name: str) -> dict[str, float]:
        cl, flags = self.cl, self.cl.mem_flags
        start = np.random.default_rng(seed).integers(1, 2**62, ITEMS, dtype=np.uint64)
        sums = np.zeros(3 * ITEMS)
        buffers = [
            cl.Buffer(self.context, flags.READ_WRITE | flags.COPY_HOST_PTR, hostbuf=array)
            for array in (np.zeros(1, np.uint32), start, sums)
        ]
        numbers = (job["scattering"], job["absorption"], job["asymmetry"], job["thickness"])
        kernel = self.kernels[name]
        kernel(self.queue, (ITEMS,), None, np.uint32(packets), *map(np.float32, numbers), *buffers)
        cl.enqueue_copy(self.queue, sums, buffers[-1])
        through, square, back = sums.reshape(ITEMS, 3).sum(axis=0) / packets
        return {"transmitted": through, "variance": square - through**2, "reflected": back}


class Mcx:
    """MCX-CL, which compiles its kernel at every call: only differences between sizes count."""

    def __init__(self) -> None:
        import pmcxcl

        self.run = pmcxcl.run
        self.versions = {"pmcxcl": pmcxcl.__version__}

    def __call__(self, job: dict[str, Any], packets: int, seed: int, _: str) -> dict[str, float]:
        """Let MCX-CL send a pencil beam and keep the path of each packet that leaves through the far side."""
        voxel = job["thickness"] / VOXELS_THROUGH  # m; MCX-CL thinks in mm
        water = [1e-3 * job["absorption"], 1e-3 * job["scattering"], job["asymmetry"], 1.0]
        found = self.run(
            DARK
            | {
                "vol": np.ones((VOXELS_ACROSS, VOXELS_ACROSS, VOXELS_THROUGH), np.uint8),
                "unitinmm": 1e3 * voxel,
                "prop": np.array([[0.0, 0.0, 1.0, 1.0], water]),
                "srcpos": [VOXELS_ACROSS / 2, VOXELS_ACROSS / 2, 0.0],
                "srcdir": [0.0, 0.0, 1.0],
                "tstart": 0.0,
                "tend": 2e-7,
                "tstep": 2e-7,
                "bc": "______000001",  # detects at the far side alone
                "issavedet": 1,
                "savedetflag": "p",
                "maxdetphoton": packets,
                "nphoton": packets,
                "seed": seed + 1,
                "gpuid": 1,
            }
        )
        weights = np.exp(-job["absorption"] * voxel * found["detp"][-1].astype(np.float64))
        through = weights.sum() / packets
        absorbed = float(found["flux"].sum(dtype=np.float64)) / packets
        return {
            "transmitted": through,
            "variance": (weights**2).sum() / packets - through**2,
            "reflected": 1.0 - through - absorbed,
        }


def cpu_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def main() -> None:
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print must not mix with answers
    program = {"loop": Loop, "mcx": Mcx}[sys.argv[1]]()
    for line in sys.stdin:
        request = json.loads(line)
        if request["what"] == "versions":
            answer: dict[str, Any] = program.versions
        else:
            start = cpu_seconds()
            answer = program(request["job"], request["packets"], request["seed"], request["absorption"])
            answer["cpu"] = cpu_seconds() - start
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
