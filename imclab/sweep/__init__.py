"""Many scenes from one: keys of a scene over lists or ranges, run here or on a cluster, resumable.

>>> units, refused = plan(scene, [Axis("medium.attenuation", ("0.42 1/m", "1.42 1/m"))])
>>> outcome = run(units, "folder", workers=2)

A script that calls `run` with several workers starts new Python processes, so it needs the usual
``if __name__ == "__main__":`` around its own work.
"""

from imclab.sweep.axes import Axis, combine, parse_axis, parse_distances
from imclab.sweep.outcome import Outcome, SweepFailedError
from imclab.sweep.run import run
from imclab.sweep.units import OneWay, Refused, Unit, plan, with_run

__all__ = [
    "Axis",
    "OneWay",
    "Outcome",
    "Refused",
    "SweepFailedError",
    "Unit",
    "combine",
    "parse_axis",
    "parse_distances",
    "plan",
    "run",
    "with_run",
]
