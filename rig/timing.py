"""From a target's distance to the delay that a generator is to be set to.

Symbols: L distance, n_g group index, t_L pulse, t_G gate width, D programmed delay. Time zero is the
leading edge of the pulse entering the water. Light comes back at 2 n_g L / c; the electronics between
the photodiode and the open tube take a time of their own, so ``D = 2 n_g L / c + offset + convention``
with ``offset`` minus the sum of the electronics, or one calibrated number. All of it is exact: decimal
text in, fractions inside, whole picoseconds out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import sqrt

from rig import delay_parts
from rig.delay_parts import PS, SPEED_OF_LIGHT, Part
from rig.errors import Fault, PlanError
from rig.models import Model, model_named, output_named
from rig.quantity import Quantity, engineering_time, exact, nearest

_FWHM_PER_SIGMA = 2.354820045
_ROUND_TRIP = "light to the target and back, 2 n_g L / c"
_CONVENTION = "convention"


@dataclass(frozen=True)
class GatePlan:
    """A planned gate: what to program, and what it will see.

    Attributes
    ----------
    delay_ps, width_ps : int
        On the generator's own grid; what is sent.
    wanted_delay_ps, wanted_width_ps : Fraction
        Before rounding to the grid.
    parts : tuple of Part
        What the wanted delay is the sum of.
    distance_m, group_index : Fraction or None
        None when the delay was given as such.
    jitter_ps, uncertainty_ps : float
        Shot to shot (rms); of the gate's position as a whole (standard uncertainty).
    convention : str
        ``"front"``, ``"centre"`` or ``"tail"``: where in the gate the target's return sits; for a
        tail gating with its own number, ``"tail"`` with ``tail_delay_ps``.
    """

    model: Model
    output: str
    delay_ps: int
    width_ps: int
    wanted_delay_ps: Fraction
    wanted_width_ps: Fraction
    parts: tuple[Part, ...]
    distance_m: Fraction | None
    group_index: Fraction
    pulse_ps: Fraction
    convention: str
    convention_text: str
    jitter_ps: float
    uncertainty_ps: float
    uncertainty_source: str
    trigger: str = "external rising"
    rate_hz: Fraction | None = None
    polarity: str | None = None
    amplitude: Quantity | None = None
    notes: tuple[str, ...] = ()

    @property
    def metres_per_ps(self) -> float:
        """Range per delay, c / (2 n_g)."""
        return SPEED_OF_LIGHT / (2 * float(self.group_index)) / PS

    @property
    def ps_per_metre(self) -> Fraction:
        """Round-trip time per metre of range, 2 n_g / c, exact."""
        return 2 * self.group_index / SPEED_OF_LIGHT * PS

    @property
    def convention_ps(self) -> Fraction:
        """What the convention adds to the round trip."""
        return sum((part.time_ps for part in self.parts if part.name == _CONVENTION), Fraction(0))

    @property
    def quantisation_ps(self) -> Fraction:
        """Sent delay minus wanted delay."""
        return self.delay_ps - self.wanted_delay_ps

    @property
    def electronics_ps(self) -> Fraction:
        """What lies between the generator's delay and the light: opening = delay + this."""
        return -sum(
            (part.time_ps for part in self.parts if part.name not in (_ROUND_TRIP, _CONVENTION)), Fraction(0)
        )

    @property
    def opening_ps(self) -> Fraction:
        """When the tube opens after the pulse's leading edge enters the water."""
        return self.delay_ps + self.electronics_ps

    @property
    def slice_m(self) -> tuple[float, float]:
        """Nearest and farthest range from which any light passes the gate."""
        near = float(self.opening_ps - self.pulse_ps) * self.metres_per_ps
        return max(near, 0.0), float(self.opening_ps + self.width_ps) * self.metres_per_ps

    @property
    def depth_m(self) -> dict[str, float]:
        """Depth of field of rectangular pulse and gate: full, flat top, FWHM, and FWHM with jitter."""
        pulse, gate = float(self.pulse_ps), float(self.width_ps)
        widened = sqrt(max(pulse, gate) ** 2 + (_FWHM_PER_SIGMA * self.jitter_ps) ** 2)
        per_ps = self.metres_per_ps
        return {
            "full": (pulse + gate) * per_ps,
            "flat": abs(pulse - gate) * per_ps,
            "fwhm": max(pulse, gate) * per_ps,
            "fwhm_with_jitter": widened * per_ps,
        }

    @property
    def reach_floor_m(self) -> float:
        """The nearest distance that a delay of zero still reaches, with this convention."""
        fixed = sum((part.time_ps for part in self.parts if part.name != _ROUND_TRIP), Fraction(0))
        return max(0.0, -float(fixed) * self.metres_per_ps)

    def with_delay(self, delay_ps: int) -> GatePlan:
        """Return the same gate at another delay of the grid."""
        return replace(self, delay_ps=delay_ps, wanted_delay_ps=Fraction(delay_ps), distance_m=None)


def plan_gate(
    distance: Quantity | None = None,
    *,
    model: str = "dg645",
    output: str | None = None,
    width: Quantity | None = None,
    pulse: Quantity = "4.5 ns",
    convention: str = "front",
    tail_delay: Quantity | None = None,
    delay: Quantity | None = None,
    water: str = "fresh",
    group_index: Quantity | None = None,
    temperature: Quantity | None = None,
    salinity: Quantity | None = None,
    wavelength: Quantity = "532 nm",
    cable_in: Quantity = "0 m",
    cable_out: Quantity = "0 m",
    cable_delay: Quantity = "5 ns/m",
    photodiode: Quantity = "0 ns",
    insertion: Quantity | None = None,
    pulser: Quantity = "0 ns",
    tube: Quantity = "0 ns",
    air_path: Quantity = "0 m",
    pretrigger: Quantity = "0 ns",
    offset: Quantity | None = None,
    offset_uncertainty: Quantity | None = None,
    jitter: Quantity = "0 ns",
    trigger: str = "external rising",
    rate: Quantity | None = None,
    polarity: str | None = None,
    amplitude: Quantity | None = None,
) -> GatePlan:
    """Plan a gate: the delay and width to program so that a target at ``distance`` is seen.

    Parameters
    ----------
    distance : quantity
        Range from where the beam enters the water. Leave it out and give ``delay`` to program a delay
        as such.
    model, output : str
        ``"dg645"`` or ``"bnc575"``; the output that gates the tube (default: the first).
    width, pulse : quantity
        Gate width (by default 3 ns, or the box's shortest) and the laser pulse's duration.
    convention : {"front", "centre", "tail"}
        Where in the gate the return sits: leading edges meet, centres meet, trailing edges meet. With
        ``tail_delay`` the gate opens that much after the return's leading edge instead.
    water, group_index, temperature, salinity, wavelength
        ``"fresh"`` or ``"sea"`` (1.357, 1.364 at 532 nm), or the index itself, or degrees C and g/kg.
    cable_in, cable_out, cable_delay
        Photodiode to generator, generator to tube: a length (with ``cable_delay``) or a measured time.
    photodiode, insertion, pulser, tube
        Delays of the electronics; ``insertion`` defaults to the model's.
    air_path : quantity
        Length of air on the light's way from pick-off to tube, out and back together.
    pretrigger : quantity
        How long the trigger comes before the light (a laser's own pre-trigger, or the generator firing
        the laser).
    offset, offset_uncertainty : quantity
        One calibrated number D0 - 2 n_g L0 / c in the place of cables, electronics, air and pre-trigger.
    jitter : quantity
        Shot-to-shot rms of photodiode, pulser and tube together; the generator's own is added.
    trigger, rate, polarity, amplitude
        What arming uses; the laser's repetition rate, for the duty check.

    Returns
    -------
    GatePlan

    Raises
    ------
    PlanError
        If something cannot be; if the wanted delay is shorter than the electronics allow, the message
        names the reach floor and what would help.
    """
    box = model_named(model)
    shortest = Fraction(max(box.shortest_width_ps, 3000), PS)
    width_s = shortest if width is None else delay_parts.positive(width, "time", "width", zero=False)
    pulse_s = delay_parts.positive(pulse, "time", "pulse", zero=False)
    index = delay_parts.index_of_water(water, group_index, temperature, salinity, wavelength)
    shift, sentence = delay_parts.convention_shift(convention, pulse_s, width_s, tail_delay)
    if offset is not None:
        fixed: tuple[Part, ...] = (Part("calibrated offset", exact(offset, "time", name="offset") * PS),)
    else:
        fixed = delay_parts.electronics(
            box,
            cable_in=cable_in,
            cable_out=cable_out,
            cable_delay=cable_delay,
            photodiode=photodiode,
            insertion=insertion,
            pulser=pulser,
            tube=tube,
            air_path=air_path,
            pretrigger=pretrigger,
        )
    metres: Fraction | None = None
    if distance is not None and delay is None:
        metres = delay_parts.positive(distance, "length", "distance", zero=False)
        light = (Part(_ROUND_TRIP, 2 * index * metres / SPEED_OF_LIGHT * PS), Part(_CONVENTION, shift * PS))
        parts = (*light, *fixed)
        wanted = sum((part.time_ps for part in parts), Fraction(0))
    elif delay is not None and distance is None:
        wanted = delay_parts.positive(delay, "time", "delay") * PS
        parts, convention, sentence = fixed, "delay", "the delay was given as such"
    else:
        came = "neither" if delay is None else "both"
        advice = "For example distance='12 m'."
        raise PlanError("gate plan", [Fault("distance, delay", came, "one of the two", advice)])
    unsure, source = _uncertainty(box, offset, offset_uncertainty)
    plan = GatePlan(
        model=box,
        output=output_named(box, output),
        delay_ps=nearest(wanted, box.step_ps) * box.step_ps,
        width_ps=nearest(width_s * PS, box.step_ps) * box.step_ps,
        wanted_delay_ps=wanted,
        wanted_width_ps=width_s * PS,
        parts=parts,
        distance_m=metres,
        group_index=index,
        pulse_ps=pulse_s * PS,
        convention=convention,
        convention_text=sentence,
        jitter_ps=sqrt(float(delay_parts.positive(jitter, "time", "jitter") * PS) ** 2 + box.jitter_ps**2),
        uncertainty_ps=unsure,
        uncertainty_source=source,
        trigger=trigger.replace("-", " ").replace("_", " ").lower(),
        rate_hz=None if rate is None else delay_parts.positive(rate, "rate", "rate", zero=False),
        polarity=polarity,
        amplitude=amplitude,
        notes=_notes(box, insertion, offset),
    )
    faults = [*_reach_faults(plan), *_range_faults(plan)]
    if faults:
        raise PlanError("gate plan", faults)
    return plan


def calibrated_offset(
    distance: Quantity,
    delay: Quantity,
    *,
    group_index: Quantity = "1.357",
    convention_shift: Quantity = "0 ns",
) -> Fraction:
    """Return the offset (seconds, exact) from a target at known range: ``D0 - 2 n_g L0 / c - convention``.

    ``delay`` is the programmed delay at which the return sat in the gate as the convention says.
    """
    metres = delay_parts.positive(distance, "length", "distance", zero=False)
    light = 2 * exact(group_index, "number", name="group_index") * metres / SPEED_OF_LIGHT
    return (
        exact(delay, "time", name="delay") - light - exact(convention_shift, "time", name="convention_shift")
    )


def _uncertainty(box: Model, offset: Quantity | None, given: Quantity | None) -> tuple[float, str]:
    if given is not None:
        if offset is None:
            fault = Fault("offset_uncertainty", repr(given), "an offset with it")
            raise PlanError("gate plan", [fault])
        return float(
            delay_parts.positive(given, "time", "offset_uncertainty") * PS
        ), "of the calibrated offset"
    if offset is not None:
        return 0.0, "not given with the calibrated offset"
    return float(box.accuracy_ps), "the generator's accuracy alone; calibrate on a target at known range"


def _notes(box: Model, insertion: Quantity | None, offset: Quantity | None) -> tuple[str, ...]:
    if insertion is not None or offset is not None or box.insertion_certain:
        return ()
    return (
        f"The insertion delay of {box.insertion_ps // 1000} ns is not confirmed by a manual: measure it.",
    )


def _reach_faults(plan: GatePlan) -> list[Fault]:
    if plan.delay_ps >= 0:
        return []
    missing = engineering_time(-plan.wanted_delay_ps)
    floor = plan.reach_floor_m
    distance = "the target" if plan.distance_m is None else f"a target at {float(plan.distance_m):g} m"
    return [
        Fault(
            "delay",
            f"{engineering_time(plan.wanted_delay_ps)} for {distance}",
            f"zero or more: the reach floor of these electronics is {floor:.2f} m",
            f"What would help: a trigger at least {missing} earlier (pretrigger: the laser's own, or the "
            "generator firing the laser), a generator with a shorter insertion delay, shorter cables, or "
            "optical delay fibre before the tube.",
        )
    ]


def _range_faults(plan: GatePlan) -> list[Fault]:
    box = plan.model
    faults = []
    if plan.width_ps < box.shortest_width_ps:
        wanted = f"at least {engineering_time(box.shortest_width_ps)}, the {box.name}'s shortest"
        faults.append(Fault("width", engineering_time(plan.wanted_width_ps), wanted))
    end = plan.delay_ps + plan.width_ps
    if end > box.longest_ps:
        wanted = f"at most {engineering_time(box.longest_ps)} together"
        faults.append(Fault("delay + width", engineering_time(end), wanted))
    if plan.rate_hz is not None and plan.rate_hz * (end + box.dead_time_ps) > PS:
        most = float(PS / Fraction(end + box.dead_time_ps))
        came = f"{float(plan.rate_hz):g} Hz"
        faults.append(Fault("rate", came, f"at most {most:g} Hz, one over the longest delay and dead time"))
    return faults
