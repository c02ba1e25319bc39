"""Drive the delay generator that times the gate of an image intensifier.

Plan a gate from a target's distance, program it, read it back, and leave the generator safe::

    with rig.open_generator("socket://127.0.0.1:5024", model="dg645") as box:
        box.apply(rig.plan_gate("40 m"))
"""

from rig.errors import (
    Fault,
    InstrumentError,
    LimitError,
    LinkError,
    NotConfirmedSafeError,
    OwnedError,
    PlanError,
    ReadBackError,
    ReplyError,
    RigError,
)
from rig.gate_file import load_gate
from rig.generator import AppliedGate, Generator
from rig.interruption import interruptible
from rig.limits import Limits, load_limits
from rig.opening import open_generator, switch_off
from rig.peak import Target, find_target
from rig.plan_report import plan_diagram, plan_dict, plan_table
from rig.quantity import seconds
from rig.replay import Replay, replay
from rig.scan import Scan, ScanStep, plan_scan, run_scan, write_steps
from rig.simulator import simulate
from rig.timing import GatePlan, calibrated_offset, plan_gate
from rig.verified import Applied, differences

__all__ = [
    "Applied",
    "AppliedGate",
    "Fault",
    "GatePlan",
    "Generator",
    "InstrumentError",
    "LimitError",
    "Limits",
    "LinkError",
    "NotConfirmedSafeError",
    "OwnedError",
    "PlanError",
    "ReadBackError",
    "Replay",
    "ReplyError",
    "RigError",
    "Scan",
    "ScanStep",
    "Target",
    "calibrated_offset",
    "differences",
    "find_target",
    "interruptible",
    "load_gate",
    "load_limits",
    "open_generator",
    "plan_diagram",
    "plan_dict",
    "plan_gate",
    "plan_scan",
    "plan_table",
    "replay",
    "run_scan",
    "seconds",
    "simulate",
    "switch_off",
    "write_steps",
]
