"""What may be sent to this rig: a TOML file written once, by someone who knows the tube.

Nothing is clamped: a clamped gate is a different experiment. The file refuses keys it does not know,
and tells all its faults together.
"""

from __future__ import annotations

import difflib
import hashlib
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from rig.errors import Fault, PlanError
from rig.models import model_named
from rig.quantity import engineering_time, exact, picoseconds

_REQUIRED = (
    "model",
    "serial",
    "max_width",
    "max_rate",
    "max_duty",
    "earliest_opening",
    "max_amplitude",
    "polarities",
    "triggers",
)
_OPTIONAL = ("schema", "output", "max_offset", "note")


@dataclass(frozen=True)
class Limits:
    """The limits of one rig.

    Attributes
    ----------
    model, serial, output : str
        The one generator that they are for, and the output that gates the tube.
    max_width_ps, earliest_opening_ps : int
        The widest gate; the smallest programmed delay, after the generator's T0.
    max_rate_hz, max_duty : Fraction
        Gates per second; width times rate.
    polarities, triggers : tuple of str
        Allowed values of ``polarity`` and ``trigger_source``.
    max_amplitude_mv, max_offset_mv : int
        Of the gate's output; the offset's magnitude.
    digest : str
        SHA-256 of the file, for the journal.
    """

    model: str
    serial: str
    output: str
    max_width_ps: int
    earliest_opening_ps: int
    max_rate_hz: Fraction
    max_duty: Fraction
    polarities: tuple[str, ...]
    triggers: tuple[str, ...]
    max_amplitude_mv: int
    max_offset_mv: int
    digest: str

    def faults_of_gate(
        self, output: str, *, delay_ps: int, width_ps: int, rate_hz: Fraction | None = None
    ) -> list[Fault]:
        """Return what is wrong with a gate; a rate that nobody gave counts as the largest allowed."""
        if output != self.output:
            return [Fault("output", output, self.output, "The limits are for one output only.")]
        rate = self.max_rate_hz if rate_hz is None else rate_hz
        duty = Fraction(width_ps, 10**12) * rate
        checks = (
            (width_ps <= self.max_width_ps, "width", engineering_time(width_ps),
             f"at most {engineering_time(self.max_width_ps)}"),
            (delay_ps >= self.earliest_opening_ps, "delay", engineering_time(delay_ps),
             f"at least {engineering_time(self.earliest_opening_ps)} (earliest_opening)"),
            (rate <= self.max_rate_hz, "rate", f"{float(rate):g} Hz",
             f"at most {float(self.max_rate_hz):g} Hz"),
            (duty <= self.max_duty, "width x rate", f"{float(duty):.6g}",
             f"at most {float(self.max_duty):g}"),
        )  # fmt: skip
        return [Fault(where, came, wanted) for fine, where, came, wanted in checks if not fine]

    def faults_of_setting(self, name: str, output: str | None, shown: Any) -> list[Fault]:
        """Return what is wrong with one setting."""
        where = name if output is None else f"{output}.{name}"
        if name == "trigger_source" and shown != "off" and shown not in self.triggers:
            return [Fault(where, repr(shown), f"one of {', '.join(self.triggers)}, or off")]
        if output != self.output:
            return []
        if name == "width" and (shown is None or shown > self.max_width_ps):
            return [Fault(where, f"{shown} ps", f"at most {self.max_width_ps} ps")]
        if name == "delay" and shown < self.earliest_opening_ps:
            return [Fault(where, f"{shown} ps", f"at least {self.earliest_opening_ps} ps (earliest_opening)")]
        if name == "polarity" and shown not in self.polarities:
            return [Fault(where, repr(shown), f"one of {', '.join(self.polarities)}")]
        if name == "amplitude" and shown > self.max_amplitude_mv:
            return [Fault(where, f"{shown} mV", f"at most {self.max_amplitude_mv} mV")]
        if name == "offset" and abs(shown) > self.max_offset_mv:
            return [Fault(where, f"{shown} mV", f"at most {self.max_offset_mv} mV either way")]
        return []

    def faults_of_state(self, settings: Mapping[str, Any], rate_hz: Fraction | None) -> list[Fault]:
        """Return what is wrong with the settings read from a box that is about to be armed."""
        gate = settings[self.output]
        width = gate.get("width_ps")
        if width is None:
            return [Fault(f"{self.output}.width", "an edge that hangs elsewhere", "a gate applied first")]
        faults = self.faults_of_gate(self.output, delay_ps=gate["delay_ps"], width_ps=width, rate_hz=rate_hz)
        if gate.get("link") != "T0":
            faults.append(Fault(f"{self.output}.link", repr(gate.get("link")), "'T0'", "Apply a plan first."))
        for key in ("polarity", "amplitude_mV", "offset_mV"):
            if key in gate:
                faults += self.faults_of_setting(key.removesuffix("_mV"), self.output, gate[key])
        return faults


def load_limits(path: str | os.PathLike[str]) -> Limits:
    """Read a limits file.

    Raises
    ------
    PlanError
        With every fault of the file.
    """
    try:
        raw = Path(path).read_bytes()
        table = tomllib.loads(raw.decode("utf-8"))
    except OSError as error:
        fault = Fault(str(path), error.strerror or "nothing readable", "a limits file", "See docs/gate.md.")
        raise PlanError("limits", [fault]) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise PlanError("limits", [Fault(str(path), f"no TOML: {error}", "a limits file")]) from error
    return read_limits(table, source=str(path), digest=hashlib.sha256(raw).hexdigest())


def read_limits(table: Mapping[str, Any], *, source: str = "limits", digest: str = "") -> Limits:
    """Build limits from a table of the file's keys.

    Raises
    ------
    PlanError
        With every fault of the table.
    """
    faults: list[Fault] = []
    known = (*_REQUIRED, *_OPTIONAL)
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, 1)
            advice = f"Did you mean {near[0]!r}?" if near else f"Known keys: {', '.join(known)}."
            faults.append(Fault(f"{source}: {key}", "a key that is not known", "known keys only", advice))
    faults += [Fault(f"{source}: {key}", "nothing", "a value") for key in _REQUIRED if key not in table]
    if faults:
        raise PlanError(source, faults)

    def number(key: str, kind: str, default: str = "0") -> Fraction:
        try:
            value = exact(table.get(key, default), kind, name=f"{source}: {key}")
        except PlanError as error:
            faults.extend(error.faults)
            return Fraction(0)
        if value < 0:
            faults.append(Fault(f"{source}: {key}", repr(table[key]), "zero or more"))
        return value

    def words(key: str) -> tuple[str, ...]:
        value = table[key]
        if not isinstance(value, list) or not value or not all(isinstance(item, str) for item in value):
            faults.append(Fault(f"{source}: {key}", repr(value), "a list of names, such as ['positive']"))
            return ()
        return tuple(item.replace("-", " ").lower() for item in value)

    if table.get("schema", 1) != 1:
        faults.append(Fault(f"{source}: schema", repr(table["schema"]), "1"))
    model = model_named(str(table["model"]))
    output = str(table.get("output", model.outputs[0])).upper()
    if output not in model.outputs:
        faults.append(Fault(f"{source}: output", repr(output), f"one of {', '.join(model.outputs)}"))
    limits = Limits(
        model=model.name,
        serial=str(table["serial"]),
        output=output,
        max_width_ps=picoseconds(number("max_width", "time")),
        earliest_opening_ps=picoseconds(number("earliest_opening", "time")),
        max_rate_hz=number("max_rate", "rate"),
        max_duty=number("max_duty", "number"),
        polarities=words("polarities"),
        triggers=words("triggers"),
        max_amplitude_mv=int(number("max_amplitude", "voltage", "0 V") * 1000),
        max_offset_mv=int(number("max_offset", "voltage", "0 V") * 1000),
        digest=digest,
    )
    if faults:
        raise PlanError(source, faults)
    return limits
