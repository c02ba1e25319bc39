"""The safe state: asked for until it is read back, or loudly not confirmed."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence

from rig.dialect import Step
from rig.errors import LinkError, NotConfirmedSafeError, ReadBackError, RigError
from rig.verified import VerifiedSettings

_ATTEMPTS = 3
_BETWEEN_ATTEMPTS_S = 0.5  # a port that was pulled may come back


def make_safe(verified: VerifiedSettings, steps: Sequence[Step]) -> None:
    """Make every step and read each back twice; a port that was lost is opened again.

    The steps are absolute and can only close the gate, so they are the one thing that is repeated.

    Raises
    ------
    NotConfirmedSafeError
        If three attempts did not bring the confirmation.
    """
    conversation = verified.conversation
    failures: list[str] = []
    for attempt in range(_ATTEMPTS):
        if attempt:
            time.sleep(_BETWEEN_ATTEMPTS_S)
            with contextlib.suppress(RigError):
                conversation.reopen()
        failures = _failures(verified, steps)
        if not failures:
            conversation.journal.write("note", "safe state confirmed")
            return
    conversation.journal.write("note", "NOT CONFIRMED SAFE")
    raise NotConfirmedSafeError(
        f"NOT CONFIRMED SAFE: {'; '.join(failures)}. The generator may still gate the tube: "
        "switch off the intensifier's high voltage, then look at the generator."
    )


def _failures(verified: VerifiedSettings, steps: Sequence[Step]) -> list[str]:
    failures: list[str] = []
    for step in steps:
        wanted = verified.dialect.property(step.name, step.output)
        native = wanted.domain.native(step.value, wanted.where)
        try:
            verified.set(wanted, step.value, native)
            if verified.ask(wanted) != native:
                raise ReadBackError(f"{wanted.where} is not {step.value}")
        except RigError as error:
            failures.append(str(error))
            if isinstance(error, LinkError):
                break  # the other steps would only wait for the same port
    return failures
