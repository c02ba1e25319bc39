"""Simulated generators: real protocols, real error codes, and faults that can be switched on."""

from __future__ import annotations

import os

from rig.models import model_named
from rig.simulator.bnc575 import SimulatedBNC575
from rig.simulator.dg645 import SimulatedDG645
from rig.simulator.faults import FAULTS, Device
from rig.simulator.server import SimulatorServer

__all__ = ["FAULTS", "SimulatorServer", "simulate", "simulated_device"]


def simulated_device(model: str, *, serial: str | None = None) -> Device:
    """Return a simulated generator without any port."""
    if model_named(model).name == "dg645":
        return SimulatedDG645() if serial is None else SimulatedDG645(serial)
    return SimulatedBNC575() if serial is None else SimulatedBNC575(serial)


def simulate(
    model: str = "dg645",
    *,
    tcp: str | None = "127.0.0.1:0",
    pty: bool = False,
    baud: int | None = None,
    seed: int = 0,
    serial: str | None = None,
    symlink: str | os.PathLike[str] | None = None,
) -> SimulatorServer:
    """Return a simulated generator on a port; serve it with ``with`` or ``run``.

    Parameters
    ----------
    model : str
        ``"dg645"`` or ``"bnc575"``.
    tcp, pty, baud, seed, symlink
        As for ``SimulatorServer``.
    serial : str, optional
        The serial number that it tells.
    """
    device = simulated_device(model, serial=serial)
    return SimulatorServer(device, tcp=tcp, pty=pty, baud=baud, seed=seed, symlink=symlink)
