"""Speed against error: every estimator on every scene, held against a long reference run.

Errors are true ones, differences from the reference, beside those that the runs state. Nothing is timed
before the kernels have been validated, and a kernel that fails is not timed at all.
"""

from __future__ import annotations

from imclab.bench.run import Bench, BenchOptions, WrongKernelError, bench, standard_scenes

__all__ = ["Bench", "BenchOptions", "WrongKernelError", "bench", "standard_scenes"]
