"""What the time between trigger and open tube is made of: light, conventions, electronics."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from rig.errors import Fault, PlanError
from rig.models import Model
from rig.quantity import Quantity, engineering_time, exact
from rig.water import TYPICAL_GROUP_INDEX, group_index

SPEED_OF_LIGHT = 299_792_458  # m/s, exact
PS = 10**12

CONVENTIONS = {
    "front": "the gate opens when the return's leading edge arrives",
    "centre": "the middle of the gate meets the middle of the return",
    "tail": "the gate closes when the return's trailing edge has passed",
}


@dataclass(frozen=True)
class Part:
    """One piece of the delay: what it is and how long it takes (ps, exact; negative shortens the delay)."""

    name: str
    time_ps: Fraction


def positive(value: Quantity, kind: str, name: str, *, zero: bool = True) -> Fraction:
    """Return the exact SI number of a quantity that may not be negative."""
    number = exact(value, kind, name=name)
    if number < 0 or (number == 0 and not zero):
        wanted = "zero or more" if zero else "more than zero"
        raise PlanError(name, [Fault(name, repr(value), wanted)])
    return number


def _cable(value: Quantity, cable_delay: Quantity, name: str) -> Fraction:
    """Seconds through a cable given as a length, or as a time already measured."""
    if isinstance(value, str) and value.strip().endswith("s"):
        return positive(value, "time", name)
    per_metre = positive(cable_delay, "delay per length", "cable_delay")
    return positive(value, "length", name) * per_metre


def index_of_water(
    water: str,
    given: Quantity | None,
    temperature: Quantity | None,
    salinity: Quantity | None,
    wavelength: Quantity,
) -> Fraction:
    """Return the group index as given, or of the water named."""
    if given is not None:
        number = exact(given, "number", name="group_index")
        if not 1 <= number <= 2:
            raise PlanError("group_index", [Fault("group_index", repr(given), "1 to 2")])
        return number
    if water not in TYPICAL_GROUP_INDEX:
        wanted = " or ".join(map(repr, TYPICAL_GROUP_INDEX))
        raise PlanError("water", [Fault("water", repr(water), wanted, "Or give group_index.")])
    nanometres = exact(wavelength, "length", name="wavelength") * 10**9
    if temperature is None and salinity is None and nanometres == 532:
        return TYPICAL_GROUP_INDEX[water]
    celsius = float(exact("20 degC" if temperature is None else temperature, "temperature"))
    typical = 35 if water == "sea" else 0
    grams = float(exact(typical if salinity is None else salinity, "number", name="salinity"))
    return Fraction(repr(round(group_index(float(nanometres), celsius, grams), 6)))


def convention_shift(
    name: str, pulse: Fraction, width: Fraction, tail_delay: Quantity | None
) -> tuple[Fraction, str]:
    """Return the seconds that the convention adds to the round trip, and its sentence."""
    if name not in CONVENTIONS:
        wanted = ", ".join(map(repr, CONVENTIONS))
        raise PlanError("convention", [Fault("convention", repr(name), wanted)])
    if tail_delay is not None:
        if name != "tail":
            raise PlanError(
                "tail_delay", [Fault("tail_delay", repr(tail_delay), "convention 'tail' with it")]
            )
        shift = exact(tail_delay, "time", name="tail_delay")
        return shift, f"the gate opens {engineering_time(shift * PS)} after the return's leading edge"
    shift = {"front": Fraction(0), "centre": (pulse - width) / 2, "tail": pulse - width}[name]
    return shift, CONVENTIONS[name]


def electronics(
    box: Model,
    *,
    cable_in: Quantity,
    cable_out: Quantity,
    cable_delay: Quantity,
    photodiode: Quantity,
    insertion: Quantity | None,
    pulser: Quantity,
    tube: Quantity,
    air_path: Quantity,
    pretrigger: Quantity,
) -> tuple[Part, ...]:
    """Return what the electronics take from the delay (negative) and what gives time back (positive)."""
    inside = Fraction(box.insertion_ps, PS) if insertion is None else positive(insertion, "time", "insertion")
    signed = (
        ("photodiode", -positive(photodiode, "time", "photodiode")),
        ("cable to the generator", -_cable(cable_in, cable_delay, "cable_in")),
        ("insertion delay", -inside),
        ("cable to the tube", -_cable(cable_out, cable_delay, "cable_out")),
        ("pulser", -positive(pulser, "time", "pulser")),
        ("tube", -positive(tube, "time", "tube")),
        ("light in air", positive(air_path, "length", "air_path") / SPEED_OF_LIGHT),
        ("pre-trigger", positive(pretrigger, "time", "pretrigger")),
    )
    return tuple(Part(name, seconds * PS) for name, seconds in signed if seconds)
