"""``open_generator``: a port or a dry run, a dialect, limits and a journal put together."""

from __future__ import annotations

import os

from rig.bnc575 import BNC575
from rig.conversation import Conversation
from rig.dg645 import DG645
from rig.dialect import Dialect
from rig.dry_run import DryRunLink
from rig.errors import LinkError, NotConfirmedSafeError
from rig.generator import Generator
from rig.journal import Journal
from rig.limits import Limits, load_limits
from rig.link import Link, SerialLink
from rig.models import model_named, output_named
from rig.ownership import Ownership
from rig.quantity import Quantity, seconds
from rig.simulator import simulated_device
from rig.simulator.faults import Device


def open_generator(
    port: str | None,
    *,
    model: str = "dg645",
    baud: int | None = None,
    limits: Limits | str | os.PathLike[str] | None = None,
    journal: str | os.PathLike[str] | None = None,
    timeout: Quantity = "1 s",
    read_only: bool = False,
) -> Generator:
    """Return a generator to be used in a ``with`` block; nothing is opened before that.

    Parameters
    ----------
    port : str or None
        A serial device, a pty, ``socket://host:port`` or ``rfc2217://host:port``. None is a dry run:
        the same code against a simulated box, nothing leaves this process.
    model : str
        ``"dg645"`` or ``"bnc575"``.
    baud : int, optional
        Of the serial line; by default the model's own.
    limits : Limits or path, optional
        What may be sent. Without limits a gate can be programmed, but not armed.
    journal : path, optional
        Where every byte is written down before it is sent.
    timeout : quantity
        How long the box may think.
    read_only : bool
        Read settings; refuse to set any.

    Examples
    --------
    >>> import rig
    >>> with rig.open_generator(None, model="dg645") as box:
    ...     gate = box.apply(rig.plan_gate("40 m"))
    >>> gate.delay_ps
    277120
    """
    box = model_named(model)
    known = load_limits(limits) if isinstance(limits, (str, os.PathLike)) else limits
    speed = baud or box.baud
    if port is None:
        link: Link = DryRunLink(simulated_device(box.name, serial=known.serial if known else None))
    else:
        link = SerialLink(port, speed)
    conversation = Conversation(
        link, _dialect(box.name), Journal(journal), timeout_s=seconds(timeout, name="timeout"), baud=speed
    )
    ownership = None if port is None else Ownership(port)
    return Generator(conversation, ownership=ownership, limits=known, read_only=read_only)


def open_simulated(device: Device) -> Generator:
    """Return a read-only generator on a simulated device of this process."""
    conversation = Conversation(
        DryRunLink(device),
        _dialect(device.model),
        Journal(),
        timeout_s=1.0,
        baud=model_named(device.model).baud,
    )
    return Generator(conversation, ownership=None, limits=None, read_only=True)


def _dialect(model: str) -> Dialect:
    return DG645() if model == "dg645" else BNC575()


def switch_off(
    port: str,
    *,
    model: str = "dg645",
    output: str | None = None,
    baud: int | None = None,
    journal: str | os.PathLike[str] | None = None,
    timeout: Quantity = "1 s",
) -> None:
    """Make a generator safe, whatever state it is in: triggers off, gate narrow, both read back.

    Raises
    ------
    NotConfirmedSafeError
        If that could not be confirmed.
    """
    box = open_generator(port, model=model, baud=baud, journal=journal, timeout=timeout)
    box.gate_output = output_named(box.dialect.model, output)
    try:
        with box:
            box.make_safe()
    except LinkError as error:
        raise NotConfirmedSafeError(f"NOT CONFIRMED SAFE: {error}") from error
