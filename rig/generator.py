"""One face for every delay generator: set and verify, read, arm, and leave it safe.

A generator is programmed with its triggers off. Only ``arm`` lets it fire, only with limits, and only
after everything that the tube depends on has been read back and found within them.
"""

from __future__ import annotations

import atexit
import contextlib
from dataclasses import dataclass
from fractions import Fraction
from types import TracebackType
from typing import Any, Self

from rig.conversation import Conversation
from rig.dialect import Dialect, Identity, Property
from rig.errors import (
    Fault,
    LimitError,
    LinkError,
    PlanError,
    ReadBackError,
)
from rig.interruption import interruptible, undisturbed
from rig.limits import Limits
from rig.ownership import Ownership
from rig.safe_state import make_safe
from rig.safeguards import check_plan, check_setting, check_state, refuse
from rig.timing import GatePlan, output_named
from rig.verified import Applied, VerifiedSettings


@dataclass(frozen=True)
class AppliedGate:
    """A gate that the generator holds, read back after everything was set."""

    plan: GatePlan
    settings: tuple[Applied, ...]
    delay_ps: int
    width_ps: int


class Generator:
    """A delay generator; nothing is opened before ``open`` or ``with``.

    Parameters
    ----------
    conversation : Conversation
    ownership : Ownership or None
        The port's lock; None where there is no port.
    limits : Limits or None
        Without them nothing can be armed, nor a level changed.
    read_only : bool
        Refuse every set, and leave the box as it is.
    """

    def __init__(
        self,
        conversation: Conversation,
        *,
        ownership: Ownership | None,
        limits: Limits | None,
        read_only: bool,
    ) -> None:
        self.conversation = conversation
        self.dialect: Dialect = conversation.dialect
        self.limits = limits
        self.inherited: dict[str, Any] = {}
        self._ownership = ownership
        self._read_only = read_only
        self._open = False
        self._verified = VerifiedSettings(conversation)
        self._running = False
        self.gate_output = limits.output if limits else self.dialect.model.outputs[0]
        self._plan: GatePlan | None = None
        self._signals = contextlib.ExitStack()

    def __enter__(self) -> Self:
        self._signals.enter_context(interruptible())
        try:
            self.open()
        except BaseException:
            self._signals.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            with undisturbed():
                self.close(failed=kind is not None)
        finally:
            self._signals.close()

    @property
    def identity(self) -> Identity:
        """Who answered ``*IDN?`` when the port was opened."""
        identity = self.conversation.identity
        if identity is None:
            raise LinkError(f"{self.conversation.link.name}: not open; wanted box.open() or a with block")
        return identity

    def open(self) -> None:
        """Take the port, learn who is there, and read all settings.

        Raises
        ------
        OwnedError, LinkError
            If the port is taken, or nothing answers.
        LimitError
            If the limits are for another box.
        """
        if self._open:
            return
        journal = self.conversation.journal
        journal.open()
        if self._ownership is not None:
            self._ownership.take()
        try:
            journal.write("open", self.conversation.link.name, model=self.dialect.model.name,
                          limits=self.limits.digest if self.limits else None)  # fmt: skip
            identity = self.conversation.open()
            self._check_identity(identity)
            if not self._read_only:
                for line in self.dialect.opening_lines():
                    self._verified.send((line,), (), line)
                self._verified.touched = False
            snapshot = self._verified.everything()
            self.inherited = snapshot.settings
            self._running = self.inherited["trigger_source"] != "off"
            journal.write("settings", identity.text, **snapshot._asdict())
        except BaseException:
            self._let_go()
            raise
        self._open = True
        atexit.register(self.close, failed=True)

    def close(self, *, failed: bool = False) -> None:
        """Make the box safe if anything was sent to it, and give the port back; safe to call twice.

        Parameters
        ----------
        failed : bool
            The work did not end as meant: the gate is narrowed as well, not only its triggers stopped.

        Raises
        ------
        NotConfirmedSafeError
            If the safe state could not be read back.
        """
        if not self._open:
            return
        self._open = False
        atexit.unregister(self.close)
        try:
            if self._verified.touched:
                self.make_safe(narrow=failed)
        finally:
            self.conversation.journal.write("close", "failed" if failed else "done")
            self._let_go()

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
        if name == "trigger_source" and shown != "off":
            return self.arm(shown)
        if name != "trigger_source" and self._running:
            self.disarm()
        return self.disarm() if name == "trigger_source" else self._verified.set(wanted, value, native)

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
        delay, width = (self.read(name, plan.output) for name in ("delay", "width"))
        if (delay, width) != (plan.delay_ps, plan.width_ps):
            held, wanted = f"{delay} ps, {width} ps wide", f"{plan.delay_ps} ps, {plan.width_ps} ps wide"
            raise ReadBackError(f"{plan.output}: the gate reads {held}; wanted {wanted}")
        return AppliedGate(plan, tuple(done), delay, width)

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

        Parameters
        ----------
        delay_ps : int
            On the box's grid.
        then_trigger : str, optional
            What to arm again afterwards; without it the triggers stay off.
        """
        wanted = self._property("delay", None)
        native = wanted.domain.native(Fraction(delay_ps, 10**12), wanted.where)
        shown = wanted.domain.shown(native)
        self._check_setting(wanted, shown)
        source = self._property("trigger_source", None)
        again = self._running and then_trigger is not None
        stop = source.commands("off") if self._running else ()
        applied = self._verified.set(wanted, delay_ps, native, before=stop)
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

    def make_safe(self, *, narrow: bool = True) -> None:
        """Stop the triggers and, with ``narrow``, make the gate as narrow as the box can; read both back.

        Raises
        ------
        NotConfirmedSafeError
            If this could not be confirmed; the box may still gate the tube.
        """
        steps = self.dialect.safe_steps(self.gate_output)
        make_safe(self._verified, [step for step in steps if narrow or step.name != "width"])
        self._running = False

    def save(self, slot: int) -> None:
        """Store all settings in the box's memory ``slot`` (1 to 9)."""
        self._check_slot(slot)
        self._verified.send((self.dialect.save_line(slot),), (), f"save {slot}")

    def recall(self, slot: int) -> dict[str, Any]:
        """Recall settings from ``slot``, with the triggers stopped in the same breath, and return them."""
        self._check_slot(slot)
        self._verified.send(self.dialect.recall_lines(slot), (), f"recall {slot}")
        self.set("trigger_source", "off")
        snapshot = self._verified.everything()
        self.conversation.journal.write("settings", f"recalled {slot}", **snapshot._asdict())
        return snapshot.settings

    def check_range(self, plan: GatePlan, first_ps: int, last_ps: int) -> None:
        """Refuse a plan whose delay is to move from ``first_ps`` to ``last_ps`` if any of it may not be."""
        if self._read_only:
            raise PlanError("gate plan", [Fault("set", "a plan", "reads only: the box was opened read-only")])
        check_plan(plan.with_delay(first_ps), self.dialect, self.limits)
        check_plan(plan.with_delay(last_ps), self.dialect, self.limits)
        refuse("gate plan", self.dialect.conflicts(self.inherited, plan.output, first_ps, last_ps))

    def _check_identity(self, identity: Identity) -> None:
        if self.limits is None:
            return
        if self.limits.model != self.dialect.model.name:
            raise LimitError("limits", [Fault("model", self.dialect.model.name, self.limits.model)])
        if self.limits.serial != identity.serial:
            advice = "Is this the right port? Each rig has limits of its own."
            raise LimitError("limits", [Fault("serial", identity.serial, self.limits.serial, advice)])

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
        if output is not None:
            output = output.upper() if output.upper() == "T0" else output_named(self.dialect.model, output)
        return self.dialect.property(name, output)

    def _let_go(self) -> None:
        self.conversation.link.close()
        if self._ownership is not None:
            self._ownership.release()
        self.conversation.journal.close()
