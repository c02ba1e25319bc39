"""A session with a generator: the port taken, the box identified, and left safe however it ends."""

from __future__ import annotations

import atexit
import contextlib
from types import TracebackType
from typing import Any, Self

from rig.conversation import Conversation
from rig.dialect import Dialect, Identity
from rig.errors import Fault, LimitError, LinkError
from rig.interruption import interruptible, undisturbed
from rig.limits import Limits
from rig.ownership import Ownership
from rig.safe_state import make_safe
from rig.verified import VerifiedSettings


class Session:
    """The life of an open generator; nothing is opened before ``open`` or ``with``.

    Parameters
    ----------
    conversation : Conversation
    ownership : Ownership or None
        The port's lock; None where there is no port.
    limits : Limits or None
        Without them nothing can be armed, nor a level changed.
    read_only : bool
        Refuse every set, and leave the box as it is.

    Attributes
    ----------
    gate_output : str
        The output that gates the tube.
    inherited : dict
        The settings that were found on opening.
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
        self.gate_output = limits.output if limits else self.dialect.model.outputs[0]
        self.inherited: dict[str, Any] = {}
        self._ownership = ownership
        self._read_only = read_only
        self._verified = VerifiedSettings(conversation)
        self._open = False
        self._running = False
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
        try:
            if self._ownership is not None:
                self._ownership.take()
            journal.open()
            journal.write("open", self.conversation.link.name, model=self.dialect.model.name,
                          limits=self.limits.digest if self.limits else None)  # fmt: skip
            identity = self.conversation.open()
            self._check_identity(identity)
            if not self._read_only:
                for line in self.dialect.opening_lines():
                    self._verified.send((line,), (), line)
                self._verified.touched = False
                for code in self.conversation.errors():  # left by others, or the first set would be blamed
                    journal.write("note", f"found error {code}: {self.dialect.meaning_of_error(code)}")
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

    def _check_identity(self, identity: Identity) -> None:
        if self.limits is None:
            return
        if self.limits.model != self.dialect.model.name:
            raise LimitError("limits", [Fault("model", self.dialect.model.name, self.limits.model)])
        if self.limits.serial != identity.serial:
            advice = "Is this the right port? Each rig has limits of its own."
            raise LimitError("limits", [Fault("serial", identity.serial, self.limits.serial, advice)])

    def _let_go(self) -> None:
        self.conversation.link.close()
        if self._ownership is not None:
            self._ownership.release()
        self.conversation.journal.close()
