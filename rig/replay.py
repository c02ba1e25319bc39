"""Replay a journal on a simulated generator: what the box holds after a program that was killed."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from rig.errors import Fault, PlanError
from rig.journal import read_journal
from rig.opening import open_simulated
from rig.simulator import simulated_device
from rig.simulator.lines import CommandSplitter


@dataclass(frozen=True)
class Replay:
    """What a journal says.

    Attributes
    ----------
    settings : dict
        What the box holds if it did all it was told.
    unconfirmed : str
        The last block, if nothing came back after it: the box may or may not have done it.
    """

    settings: dict[str, Any]
    unconfirmed: str


def replay(path: str | os.PathLike[str]) -> Replay:
    """Replay the last session of a journal on a simulated generator.

    It starts from the settings that the session found, and runs every block that was sent after them.

    Raises
    ------
    PlanError
        If the journal holds no session that got as far as reading the settings.
    """
    entries = list(read_journal(path))
    opened = [index for index, entry in enumerate(entries) if entry.kind == "open"]
    session = entries[opened[-1] :] if opened else []
    found = next((index for index, entry in enumerate(session) if entry.kind == "settings"), None)
    if found is None:
        fault = Fault(str(path), "no settings", "a session that got as far as reading the generator")
        raise PlanError("journal", [fault])
    device = simulated_device(str(session[0].details["model"]))
    splitter = CommandSplitter(device.separators, device.input_limit)
    unconfirmed = ""
    for entry in session[found:]:
        if entry.kind == "settings":
            for command in entry.details["commands"]:
                device.feed(command)
        elif entry.kind == "sent":
            for command in splitter.take(entry.text.encode("latin-1")):
                device.feed(command)
            unconfirmed = entry.text
        elif entry.kind == "received":
            unconfirmed = ""
    with open_simulated(device) as box:
        return Replay(box.inherited, unconfirmed)
