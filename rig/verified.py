"""Settings that are set, asked after for errors, read back strictly, and compared on the box's own grid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from rig.conversation import Conversation
from rig.dialect import Line, Native, Property
from rig.errors import InstrumentError, ReadBackError, ReplyError


@dataclass(frozen=True)
class Applied:
    """One setting as it was requested, sent, and read back."""

    name: str
    output: str | None
    unit: str
    requested: Any
    sent: Any
    read: Any


class Snapshot(NamedTuple):
    """All settings: the box's by name, each output's in a table of its own; and what would restore them."""

    settings: dict[str, Any]
    commands: tuple[str, ...]


class VerifiedSettings:
    """Reads and sets the properties of one generator.

    Parameters
    ----------
    conversation : Conversation

    Attributes
    ----------
    touched : bool
        Whether anything that can change the box was sent.
    """

    def __init__(self, conversation: Conversation) -> None:
        self.conversation = conversation
        self.dialect = conversation.dialect
        self.touched = False

    def ask(self, wanted: Property) -> Native:
        """Return a property in its native form, asked twice."""
        return wanted.parse(self.conversation.ask(wanted.queries, f"read {wanted.where}"))

    def everything(self) -> Snapshot:
        """Read all settings."""
        chosen = [self.dialect.property(name, None) for name in self.dialect.system_properties]
        for output in self.dialect.model.outputs:
            chosen += [self.dialect.property(name, output) for name in self.dialect.output_properties]
        queries = [line for one in chosen for line in one.queries]
        replies = iter(self.conversation.ask(queries, "all settings"))
        found: dict[str, Any] = {}
        commands: list[str] = []
        for one in chosen:
            native = one.parse([next(replies) for _ in one.queries])
            place = found if one.output is None else found.setdefault(one.output, {})
            place[one.key] = one.domain.shown(native)
            commands += one.commands(native)
        return Snapshot(found, tuple(commands))

    def set(
        self,
        wanted: Property,
        requested: Any,
        native: Native,
        *,
        before: tuple[str, ...] = (),
        held: tuple[Property, Native] | None = None,
    ) -> Applied:
        """Set one property and read it back.

        In the same block ``before`` goes out ahead of it, and ``held``, another property, must read as
        it should.

        Raises
        ------
        InstrumentError
            If the box reports an error.
        ReadBackError
            If the box holds something else afterwards.
        """
        read: Native = None
        also = held[0].queries if held else ()
        meaning = f"{wanted.where} = {wanted.domain.shown(native)}"
        try:
            queries = (*wanted.queries, *also)
            replies = self.send((*before, *wanted.commands(native)), queries, meaning)
            split = len(wanted.queries)
            if held is None or held[0].parse(replies[split:]) == held[1]:
                read = wanted.parse(replies[:split])
        except ReplyError as error:
            self.conversation.resynchronise(str(error))
        if read != native:
            read = self._read_in_doubt(wanted, native)
            if held is not None:
                self._read_in_doubt(*held)
        shown = wanted.domain.shown
        return Applied(wanted.name, wanted.output, wanted.domain.unit, requested, shown(native), shown(read))

    def send(self, commands: tuple[str, ...], queries: tuple[Line, ...], meaning: str) -> list[str]:
        """Send sets with what confirms them, raise what the box complains of, return the queries' replies."""
        self.touched = True
        acknowledgement, error_query = self.dialect.acknowledgement, self.dialect.error_query
        lines = [Line(command, acknowledgement) for command in commands]
        lines += [] if error_query is None else [error_query]
        replies = self.conversation.exchange([*lines, *queries], meaning)
        split = len(replies) - len(queries)
        complaints = [verdict for verdict in replies[:split] if verdict not in ("ok", "0")]
        if complaints and error_query is not None:
            complaints += self.conversation.errors()
        self._raise(complaints, meaning)
        return replies[split:]

    def _read_in_doubt(self, wanted: Property, native: Native) -> Native:
        """Find out what the box holds after a set that nobody confirmed; the set is not repeated."""
        self.conversation.recoveries += 1
        self._raise(self.conversation.errors(), wanted.where)
        read = self.ask(wanted)
        if read != native:
            unit, shown = wanted.domain.unit, wanted.domain.shown
            raise ReadBackError(
                f"{self.conversation.link.name}: {wanted.where} reads {shown(read)} {unit}; "
                f"{shown(native)} was sent. The box does not hold what it was told: stop and look at it."
            )
        return read

    def _raise(self, codes: list[str], meaning: str) -> None:
        if codes:
            words = ", ".join(f"{code} ({self.dialect.meaning_of_error(code)})" for code in codes)
            raise InstrumentError(f"{self.conversation.link.name}: {meaning}: the box reports {words}")


def differences(
    before: Mapping[str, Any], after: Mapping[str, Any], prefix: str = ""
) -> Iterator[tuple[str, Any, Any]]:
    """Yield what differs between two sets of settings: dotted name, before, after."""
    for key, value in after.items():
        held = before.get(key)
        if isinstance(value, dict):
            yield from differences(held or {}, value, f"{prefix}{key}.")
        elif held != value:
            yield f"{prefix}{key}", held, value
