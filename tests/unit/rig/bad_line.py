"""Generators on lines that lie, cut and stammer: in this process, on a clock that nobody waits for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rig.bnc575 import BNC575
from rig.conversation import Conversation
from rig.dg645 import DG645
from rig.dry_run import DryRunLink
from rig.generator import Generator
from rig.journal import Journal
from rig.limits import Limits, read_limits
from rig.simulator import simulated_device
from rig.simulator.faults import Device, Faults

SERIALS = {"dg645": "004025", "bnc575": "02311"}


def generous_limits(model: str, **changes: Any) -> Limits:
    """Limits that allow nearly everything, but for what a test tightens."""
    table = {
        "model": model,
        "serial": SERIALS[model],
        "max_width": "2000 s",
        "earliest_opening": "0 ns",
        "max_rate": "10 MHz",
        "max_duty": 1e12,
        "max_amplitude": "20 V",
        "max_offset": "2 V",
        "polarities": ["positive", "negative", "complement"],
        "triggers": [
            "internal",
            "external rising",
            "external falling",
            "single external rising",
            "single external falling",
            "line",
        ],
    }
    return read_limits(table | changes)


@dataclass
class Bench:
    """A generator, its faults, and the device behind them."""

    box: Generator
    device: Device
    faults: Faults
    link: DryRunLink

    def told(self, line: str) -> str:
        """Ask the device past the line."""
        reply = self.device.feed(line)
        assert reply is not None, line
        return reply


def bench(model: str, *, seed: int = 0, limits: Limits | None = None, read_only: bool = False) -> Bench:
    device = simulated_device(model)
    faults = Faults(device, seed=seed)
    link = DryRunLink(device, faults)
    dialect = DG645() if model == "dg645" else BNC575()
    conversation = Conversation(link, dialect, Journal(), timeout_s=1.0, baud=115200)
    box = Generator(conversation, ownership=None, limits=limits, read_only=read_only)
    return Bench(box, device, faults, link)
