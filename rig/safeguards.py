"""What is checked before a byte goes out: the box's own ranges, and the limits of the rig."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from rig.dialect import Dialect, Property
from rig.errors import Fault, LimitError, PlanError
from rig.limits import Limits
from rig.timing import GatePlan

_NEED_LIMITS = frozenset({"polarity", "amplitude", "offset"})  # they act on the tube without any trigger
_ADVICE = "Write one as in docs/gate.md, and give it as limits."


def refuse(source: str, faults: list[Fault]) -> None:
    """Raise ``LimitError`` if there is any fault."""
    if faults:
        raise LimitError(source, faults)


def check_plan(plan: GatePlan, dialect: Dialect, limits: Limits | None) -> None:
    """Refuse a plan that the box cannot hold or the limits forbid.

    Raises
    ------
    PlanError, LimitError
    """
    if plan.model.name != dialect.model.name:
        fault = Fault("model", plan.model.name, dialect.model.name, "Plan for this box.")
        raise PlanError("gate plan", [fault])
    for name, picoseconds in (("delay", plan.delay_ps), ("width", plan.width_ps)):
        wanted = dialect.property(name, plan.output)
        wanted.domain.native(Fraction(picoseconds, 10**12), wanted.where)
    for name, level in (("polarity", plan.polarity), ("amplitude", plan.amplitude)):
        if level is not None:
            wanted = dialect.property(name, plan.output)
            check_setting(wanted, wanted.domain.shown(wanted.domain.native(level, wanted.where)), limits)
    source = dialect.property("trigger_source", None)
    source.domain.native(plan.trigger, source.where)
    if limits is None:
        return
    faults = limits.faults_of_gate(
        plan.output, delay_ps=plan.delay_ps, width_ps=plan.width_ps, rate_hz=plan.rate_hz
    )
    faults += limits.faults_of_setting("trigger_source", None, plan.trigger)
    refuse("gate plan", faults)


def check_setting(wanted: Property, shown: Any, limits: Limits | None) -> None:
    """Refuse one setting that the limits forbid, or that needs limits where there are none.

    Raises
    ------
    LimitError
    """
    arms = wanted.name == "trigger_source" and shown != "off"
    if limits is None:
        if arms or wanted.name in _NEED_LIMITS:
            raise LimitError("set", [Fault(wanted.where, repr(shown), "a limits file first", _ADVICE)])
        return
    refuse("set", limits.faults_of_setting(wanted.name, wanted.output, shown))


def check_state(
    settings: dict[str, Any], source: str, rate_hz: Fraction | None, limits: Limits | None
) -> None:
    """Refuse to arm a box whose settings, as read back, are not within the limits.

    Raises
    ------
    LimitError
    """
    if limits is None:
        raise LimitError("arming", [Fault("trigger_source", repr(source), "a limits file first", _ADVICE)])
    rates = [_internal_rate(settings) if source == "internal" else rate_hz or limits.max_rate_hz]
    if settings["burst"]:
        within = settings.get("burst_period_ps") or settings["trigger_period_ps"]
        rates.append(Fraction(10**12, within))
    refuse("arming", limits.faults_of_state(settings, max(rates)))


def _internal_rate(settings: dict[str, Any]) -> Fraction:
    if "trigger_rate_uHz" in settings:
        return Fraction(settings["trigger_rate_uHz"], 10**6)
    return Fraction(10**12, settings["trigger_period_ps"])
