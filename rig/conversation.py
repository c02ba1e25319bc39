"""Questions and answers with a generator: whose reply is whose, and what to do when that is in doubt.

The rules, each against a fault that other drivers have: a reply is whole, ends in CR LF, and matches
its question's own pattern; what arrives unasked, late or garbled ends the trust in the line, and
nothing else is believed until the box has told its identity after a silence; questions are asked twice
and closed by ``*IDN?``, so that a stale reply shifts the count and is seen; a set is never repeated
blindly.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator, Sequence

from rig.dialect import Dialect, Identity, Line
from rig.errors import InstrumentError, LinkError, ReplyError
from rig.journal import Journal
from rig.link import Link

_ANY_IDENTITY = re.compile(r"[^,]+,[^,]+,[^,]+,[^,]+")
_RESYNCHRONISE_S = 10.0
_ATTEMPTS = 3
_LONGEST_BLOCK = 200  # bytes; the DG645 holds 255 and forgets all when they overflow


class Conversation:
    """One generator on one link, one exchange at a time.

    Parameters
    ----------
    link : Link
    dialect : Dialect
    journal : Journal
    timeout_s : float
        How long the box may think beyond the time that the bytes take on the wire.
    baud : int
        Bits per second of the wire, for that time.
    """

    def __init__(
        self, link: Link, dialect: Dialect, journal: Journal, *, timeout_s: float, baud: int
    ) -> None:
        self.link = link
        self.dialect = dialect
        self.journal = journal
        self.recoveries = 0
        self.identity: Identity | None = None
        self._timeout_s = timeout_s
        self._byte_s = 10.0 / baud
        self._lock = threading.Lock()
        self._trusted = False

    def open(self) -> Identity:
        """Open the link, wake the box, and learn who it is.

        Raises
        ------
        LinkError
            If nothing answers.
        ReplyError
            If something else than this model answers.
        """
        self.link.open()
        self.identity = self._identify()
        return self.identity

    def reopen(self) -> None:
        """Open a link that was lost once more; the next exchange begins with the box's identity."""
        self.link.close()
        self._trusted = False
        self.link.open()

    def exchange(self, lines: Sequence[Line], meaning: str) -> list[str]:
        """Send lines and return the reply to each that has one.

        Raises
        ------
        ReplyError
            If a reply is late, cut, or not what its line asks for; the line is then not trusted any more.
        LinkError
            If the port fails.
        """
        if not self._lock.acquire(timeout=60):
            raise LinkError(f"{self.link.name}: another thread has talked to the box for a minute")
        try:
            self._make_trusted()
            self._trusted = False
            replies = self._talk(lines, meaning)
            self._trusted = True
            return replies
        finally:
            self._lock.release()

    def ask(self, queries: Sequence[Line], meaning: str = "read") -> list[str]:
        """Ask everything twice, close with the identity, and return replies that agree.

        Raises
        ------
        ReplyError
            If three attempts, each after a resynchronisation, brought no such replies.
        """
        replies: list[str] = []
        for block in self._blocks(queries):
            replies += self._ask_block(block, meaning)
        return replies

    def errors(self) -> list[str]:
        """Empty the box's error queue and return the codes, oldest reading first."""
        if self.dialect.error_query is None:
            return []
        codes: list[str] = []
        for _ in range(25):
            code = self.exchange([self.dialect.error_query, self._fence()], "error queue")[0]
            if int(code) == 0:
                return codes
            codes.append(code)
        raise InstrumentError(f"{self.link.name}: the error queue does not empty ({', '.join(codes)})")

    def resynchronise(self, reason: str) -> None:
        """Trust the line no more: what comes next begins with silence and the identity."""
        self._trusted = False
        self.journal.write("note", f"resynchronise: {reason}")

    def _fence(self) -> Line:
        if self.identity is None:
            raise LinkError(f"{self.link.name}: not open; wanted box.open() or a with block")
        return Line("*IDN?", re.compile(re.escape(self.identity.text)))

    def _blocks(self, queries: Sequence[Line]) -> Iterator[list[Line]]:
        block: list[Line] = []
        size = 0
        for query in queries:
            if block and size + 2 * len(query.text) + 2 > _LONGEST_BLOCK - 10:
                yield block
                block, size = [], 0
            block.append(query)
            size += 2 * (len(query.text) + len(self.dialect.terminator))
        if block:
            yield block

    def _ask_block(self, queries: Sequence[Line], meaning: str) -> list[str]:
        failure = ""
        for _ in range(_ATTEMPTS):
            try:
                replies = self.exchange([*queries, *queries, self._fence()], meaning)
            except ReplyError as error:
                failure = str(error)
                self.recoveries += 1
                continue
            first, second = replies[: len(queries)], replies[len(queries) : -1]
            if first == second:
                return first
            failure = f"two readings differ: {first} and {second}"
            self.recoveries += 1
            self.resynchronise(failure)
        raise ReplyError(f"{self.link.name}: {meaning}: {failure}; {_ATTEMPTS} attempts. Check the line.")

    def _make_trusted(self) -> None:
        if self._trusted:
            stray = self.link.pending()
            if not stray:
                return
            self.journal.write_received(stray)
            self.resynchronise("bytes that nobody asked for")
            self.recoveries += 1
        self._identify()

    def _identify(self) -> Identity:
        """Wait for silence, then take nothing for an answer but the box's identity."""
        give_up = self.link.now() + _RESYNCHRONISE_S
        others: list[str] = []
        while self.link.now() < give_up and len(others) < _ATTEMPTS:
            self._hear_silence(give_up)
            self._send(self.dialect.terminator + "*IDN?" + self.dialect.terminator, "who are you")
            deadline = self.link.now() + self._timeout_s + 80 * self._byte_s
            while raw := self.link.read_line(deadline):
                self.journal.write_received(raw)
                text = raw.decode("latin-1").removesuffix("\r\n")
                identity = self.dialect.identity(text)
                if identity is not None and self.identity in (None, identity):
                    self._hear_silence(give_up)
                    self._trusted = True
                    return identity
                if _ANY_IDENTITY.fullmatch(text):
                    others.append(text)
        if others:
            wanted = self.identity.text if self.identity else f"a {self.dialect.model.title}"
            raise ReplyError(
                f"{self.link.name}: {others[-1]!r} answers; wanted {wanted}. Check model and port."
            )
        raise LinkError(
            f"{self.link.name}: no answer to *IDN? within {_RESYNCHRONISE_S:g} s; wanted a "
            f"{self.dialect.model.title}. Check the power, the cable, and the baud rate."
        )

    def _hear_silence(self, give_up: float) -> None:
        stray = self.link.drain(0.05 + 30 * self._byte_s, give_up)
        if stray:
            self.journal.write_received(stray)

    def _send(self, text: str, meaning: str) -> None:
        block = text.encode("ascii")
        self.journal.write_sent(block, meaning)
        self.link.write(block)

    def _talk(self, lines: Sequence[Line], meaning: str) -> list[str]:
        if not self.dialect.stacked:
            return [self._talk_block([line], meaning)[0] for line in lines if line.reply is not None]
        return self._talk_block(lines, meaning)

    def _talk_block(self, lines: Sequence[Line], meaning: str) -> list[str]:
        end = self.dialect.terminator
        text = "".join(line.text + end for line in lines)
        self._send(text, meaning)
        asked = [line for line in lines if line.reply is not None]
        deadline = self.link.now() + self._timeout_s + self._byte_s * (len(text) + 64 * len(asked))
        replies = []
        echoes = {line.text for line in lines}
        for line in asked:
            reply = self._reply(line, deadline)
            while reply in echoes:
                reply = self._reply(line, deadline)
            if line.reply is None or line.reply.fullmatch(reply) is None:
                raise ReplyError(
                    f"{self.link.name}: reply to {line.text} was {reply!r}; another form was wanted"
                )
            replies.append(reply)
        return replies

    def _reply(self, line: Line, deadline: float) -> str:
        raw = self.link.read_line(deadline)
        if raw:
            self.journal.write_received(raw)
        if not raw.endswith(b"\r\n"):
            came = repr(raw) if raw else "nothing"
            raise ReplyError(
                f"{self.link.name}: reply to {line.text} was {came}; wanted one that ends in CR LF, in time"
            )
        return raw[:-2].decode("latin-1")
