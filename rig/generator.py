"""One face for every delay generator: set and verify, read, arm, and leave it safe.

A generator is programmed with its triggers off. Only ``arm`` lets it fire, only with limits, and only
after everything that the tube depends on has been read back and found within them.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from rig.dialect import Property
from rig.errors import Fault, LimitError, PlanError, ReadBackError
from rig.safeguards import check_plan, check_setting, check_state, refuse
from rig.session import Session
from rig.timing import GatePlan
from rig.verified import Applied


@dataclass(frozen=True)
class AppliedGate:
    """A gate that the generator holds, read back after everything was set."""

    plan: GatePlan
    settings: tuple[Applied, ...]
    delay_ps: int
    width_ps: int


class Generator(Session):
    """A delay generator that can be read, programmed and armed; what ``open_generator`` returns."""

    _plan: GatePlan | None = None

    def read(self, name: str, output: str | None = None) -> Any:
        """Return one setting, asked twice.

        Parameters
        ----------
        name : str
            Such as ``"delay"`` (ps), ``"amplitude"`` (mV), ``"trigger_source"``.
        output : str, optional
            Which output; leave it out for settings of the whole box.
        """
        wanted = self._property(name, output)
        return wanted.domain.shown(self._verified.ask(wanted))

    def settings(self) -> dict[str, Any]:
        """Return all settings: those of the box by name, those of each output in a table of its own."""
        return self._verified.everything().settings

    def errors(self) -> list[str]:
        """Empty the box's error queue and return what it held, in words."""
        return [f"{code}: {self.dialect.meaning_of_error(code)}" for code in self.conversation.errors()]

    def set(self, name: str, value: Any, output: str | None = None) -> Applied:
        """Set one thing, ask for errors, read it back strictly, and compare it on the box's own grid.

        Raises
        ------
        PlanError, LimitError
            If the value cannot be or may not be; nothing is sent.
        InstrumentError
            If the box reports an error.
        ReadBackError
            If the box holds something else afterwards.
        """
        wanted = self._property(name, output)
        native = wanted.domain.native(value, wanted.where)
        shown = wanted.domain.shown(native)
        self._check_setting(wanted, shown)
        if name == "trigger_source":
            return self.disarm() if shown == "off" else self.arm(shown)
        if self._running:
            self.disarm()
        return self._verified.set(wanted, value, native)

    def apply(self, plan: GatePlan) -> AppliedGate:
        """Program a planned gate with the triggers off, and read all of it back.

        The box stays disarmed: ``arm`` lets it fire.

        Raises
        ------
        PlanError, LimitError
            If the plan cannot or may not be; not one byte is sent.
        """
        self.check_range(plan, plan.delay_ps, plan.delay_ps)
        self._plan, self.gate_output = plan, plan.output
        done = [self.set("trigger_source", "off")]
        for name, value in (("polarity", plan.polarity), ("amplitude", plan.amplitude)):
            if value is not None:
                done.append(self.set(name, value, plan.output))
        for step in self.dialect.gate_steps(plan.output, plan.delay_ps, plan.width_ps):
            done.append(self.set(step.name, step.value, step.output))
        self.check_held(plan.delay_ps)
        return AppliedGate(plan, tuple(done), plan.delay_ps, plan.width_ps)

    def check_held(self, delay_ps: int) -> None:
        """Read the gate once more, all of it: somebody at the panel or a power cut may have changed it.

        Raises
        ------
        ReadBackError
            If the box does not hold the applied plan at this delay, or fires when it should not.
        """
        wanted = {"delay": delay_ps, "width": self._applied_plan().width_ps}
        held = {name: self.read(name) for name in wanted}
        running = self.read("trigger_source") != "off"
        if held != wanted or running != self._running:
            firing = "running" if running else "stopped"
            raise ReadBackError(f"{self.gate_output}: the box holds {held}, {firing}; wanted {wanted}")

    def arm(self, trigger: str | None = None) -> Applied:
        """Let the box fire, after all that the tube depends on was read back and found within the limits.

        Parameters
        ----------
        trigger : str, optional
            The trigger source; by default that of the applied plan.
        """
        source = trigger or (self._plan.trigger if self._plan else "external rising")
        wanted = self._property("trigger_source", None)
        native = wanted.domain.native(source, wanted.where)
        self._check_setting(wanted, wanted.domain.shown(native))
        check_state(self.settings(), source, self._plan.rate_hz if self._plan else None, self.limits)
        if "enabled" in self.dialect.output_properties:
            self._verified.set(self._property("enabled", self.gate_output), True, True)
        self._running = True
        return self._verified.set(wanted, source, native)

    def move_gate(self, delay_ps: int, *, then_trigger: str | None = None) -> int:
        """Move the applied gate to another delay with the triggers stopped, and return what is read back.

        Before the triggers start again the width is read back as well.

        Parameters
        ----------
        delay_ps : int
            On the box's grid.
        then_trigger : str, optional
            What to arm again afterwards; without it the triggers stay off.
        """
        plan = self._applied_plan()
        wanted = self._property("delay", None)
        native = wanted.domain.native(Fraction(delay_ps, 10**12), wanted.where)
        self._check_setting(wanted, wanted.domain.shown(native))
        if self._running and then_trigger is None:
            self.disarm()
        again = self._running
        source = self._property("trigger_source", None)
        width = self._property("width", None)
        held = (width, width.domain.native(Fraction(plan.width_ps, 10**12), width.where))
        applied = self._verified.set(
            wanted,
            delay_ps,
            native,
            before=source.commands("off") if again else (),
            held=held if again else None,
        )
        if again:
            self._verified.set(source, then_trigger, source.domain.native(then_trigger, source.where))
        elif then_trigger is not None:
            self.arm(then_trigger)
        read: int = applied.read
        return read

    def disarm(self) -> Applied:
        """Stop the triggers."""
        source = self._property("trigger_source", None)
        self._check_setting(source, "off")
        applied = self._verified.set(source, "off", source.domain.native("off", source.where))
        self._running = False
        return applied

    def save(self, slot: int) -> None:
        """Store all settings in the box's memory ``slot`` (1 to 9)."""
        self._check_slot(slot)
        self._verified.send((self.dialect.save_line(slot),), (), f"save {slot}")

    def recall(self, slot: int) -> dict[str, Any]:
        """Recall settings from ``slot``, with the triggers stopped in the same breath, and return them."""
        self._check_slot(slot)
        if self.limits is None:
            raise LimitError("recall", [Fault("limits", "none", "a limits file: memories hold levels too")])
        self._verified.send(self.dialect.recall_lines(slot), (), f"recall {slot}")
        self.set("trigger_source", "off")
        snapshot = self._verified.everything()
        self.conversation.journal.write("settings", f"recalled {slot}", **snapshot._asdict())
        if self.limits is not None:
            gate = snapshot.settings[self.gate_output]
            levels = (("polarity", "polarity"), ("amplitude", "amplitude_mV"), ("offset", "offset_mV"))
            faults = [
                fault
                for name, key in levels
                if key in gate
                for fault in self.limits.faults_of_setting(name, self.gate_output, gate[key])
            ]
            refuse("recalled settings (the triggers are off)", faults)
        return snapshot.settings

    def check_range(self, plan: GatePlan, first_ps: int, last_ps: int) -> None:
        """Refuse a plan whose delay is to move from ``first_ps`` to ``last_ps`` if any of it may not be."""
        if self._read_only:
            raise PlanError("gate plan", [Fault("set", "a plan", "reads only: the box was opened read-only")])
        check_plan(plan.with_delay(first_ps), self.dialect, self.limits)
        check_plan(plan.with_delay(last_ps), self.dialect, self.limits)
        refuse("gate plan", self.dialect.conflicts(self.inherited, plan.output, first_ps, last_ps))

    def _applied_plan(self) -> GatePlan:
        if self._plan is None:
            raise PlanError("gate", [Fault("plan", "none", "an applied plan", "Call apply first.")])
        return self._plan

    def _check_setting(self, wanted: Property, shown: Any) -> None:
        if self._read_only:
            raise PlanError("set", [Fault(wanted.where, "a set", "reads only: the box was opened read-only")])
        check_setting(wanted, shown, self.limits)

    def _check_slot(self, slot: int) -> None:
        if self._read_only or not 1 <= slot <= 9:
            raise PlanError("memory", [Fault("slot", repr(slot), "1 to 9 of a box that may be written")])

    def _property(self, name: str, output: str | None) -> Property:
        if output is None and name in self.dialect.output_properties:
            output = self.gate_output
        return self.dialect.property(name, None if output is None else self.dialect.output_named(output))
