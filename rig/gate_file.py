"""A gate file: the constants of a rig (cables, delays, water) that ``plan_gate`` takes, kept as TOML."""

from __future__ import annotations

import difflib
import inspect
import os
import tomllib
from pathlib import Path
from typing import Any

from rig.errors import Fault, PlanError
from rig.timing import plan_gate

PLAN_OPTIONS = tuple(inspect.signature(plan_gate).parameters)


def load_gate(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the arguments of ``plan_gate`` from a file; unknown keys are refused.

    Raises
    ------
    PlanError
        With every fault of the file.
    """
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        fault = Fault(str(path), error.strerror or "nothing readable", "a gate file")
        raise PlanError("gate file", [fault]) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise PlanError("gate file", [Fault(str(path), f"no TOML: {error}", "a gate file")]) from error
    if table.pop("schema", 1) != 1:
        raise PlanError("gate file", [Fault(f"{path}: schema", "another number", "1")])
    faults = []
    for key in table:
        if key not in PLAN_OPTIONS:
            near = difflib.get_close_matches(key, PLAN_OPTIONS, 1)
            advice = f"Did you mean {near[0]!r}?" if near else f"Known keys: {', '.join(PLAN_OPTIONS)}."
            faults.append(Fault(f"{path}: {key}", "a key that is not known", "known keys only", advice))
    if faults:
        raise PlanError("gate file", faults)
    return table
