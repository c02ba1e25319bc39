"""The side door of a simulated generator: words in, JSON out, while it runs."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rig.simulator.faults import FAULTS

if TYPE_CHECKING:
    from rig.simulator.server import SimulatorServer


def answer(server: SimulatorServer, command: str) -> str:
    """Obey one command and return one JSON object.

    The commands: ``fault NAME [after=N] [count=N] [argument=X]``, ``clear``, ``faults``, ``feed LINE``
    (past all faults), ``trigger [SOURCE]``, ``advance PICOSECONDS``, ``edges``, ``unplug [SECONDS]``,
    ``power-cycle``, ``help``.
    """
    word, _, rest = command.partition(" ")
    act = _ACTS.get(word)
    if act is None:
        return json.dumps({"error": f"{word!r}; wanted one of {', '.join(_ACTS)}"})
    try:
        return json.dumps({"ok": True, **act(server, rest.strip())})
    except (ValueError, KeyError) as error:
        return json.dumps({"error": str(error)})


def _fault(server: SimulatorServer, rest: str) -> dict[str, Any]:
    name, *options = rest.split()
    chosen = dict(option.partition("=")[::2] for option in options)
    server.faults.start(
        name,
        after=int(chosen.get("after", "0")),
        count=int(chosen.get("count", "1")),
        argument=float(chosen.get("argument", "0")),
    )
    return {"active": server.faults.active()}


def _clear(server: SimulatorServer, rest: str) -> dict[str, Any]:
    server.faults.clear()
    return {"active": []}


def _unplug(server: SimulatorServer, rest: str) -> dict[str, Any]:
    server.unplug(float(rest or "1"))
    return {}


def _power_cycle(server: SimulatorServer, rest: str) -> dict[str, Any]:
    server.device.power_cycle()
    return {}


def _advance(server: SimulatorServer, rest: str) -> dict[str, Any]:
    server.device.advance(int(rest))
    return {}


_ACTS: dict[str, Callable[[SimulatorServer, str], dict[str, Any]]] = {
    "fault": _fault,
    "clear": _clear,
    "faults": lambda server, rest: {"active": server.faults.active(), "known": FAULTS},
    "feed": lambda server, rest: {"reply": server.device.feed(rest)},
    "trigger": lambda server, rest: {"fired": server.device.trigger(rest or "external rising")},
    "advance": _advance,
    "edges": lambda server, rest: {"edges": [edge._asdict() for edge in server.device.edges]},
    "unplug": _unplug,
    "power-cycle": _power_cycle,
    "help": lambda server, rest: {"commands": list(_ACTS)},
}
