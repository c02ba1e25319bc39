"""A gate beside the target's return, and less than a photon, are told; ordinary pictures are not."""

from __future__ import annotations

import pytest

import imclab
from imclab.transport.arrival import gate_beside_target, nothing_arrived
from imclab.transport.setup import setup_of
from tests.imaging_scenes import scene

RETURN_NS = 9.1
"""Of a target at 1 m, group index 1.364; six standard deviations of the pulse are 11.5 ns."""


@pytest.mark.parametrize(
    ("delay", "told"),
    [("7.6 ns", False), ("20 ns", False), ("22 ns", True), ("-5 ns", False), ("-9 ns", True)],
)
def test_a_gate_that_misses_the_target_by_the_whole_pulse(delay: str, told: bool) -> None:
    gated = scene(0.42, gate={"delay": delay, "width": "3 ns"})
    notes = gate_beside_target(gated, setup_of(gated))
    assert bool(notes) is told
    assert all(f"comes back at {RETURN_NS}" in note and "open from" in note for note in notes)


def test_without_a_gate_or_with_one_on_the_target_there_is_nothing_to_tell() -> None:
    for gate in (None, {"center": "target", "width": "3 ns"}):
        gated = scene(0.42, gate=gate)
        assert gate_beside_target(gated, setup_of(gated)) == ()


def test_less_than_a_photon_in_a_thousand_pulses_is_nothing() -> None:
    photon = 3.734e-19  # J at 532 nm
    assert nothing_arrived(scene(0.42), 2e-3 * photon) == ()
    assert "nothing arrived" in nothing_arrived(scene(0.42), 0.5e-3 * photon)[0]
    assert "nothing arrived" in nothing_arrived(scene(0.42), 0.0)[0]


def test_a_late_gate_says_so_in_the_result_and_one_on_time_does_not() -> None:
    """In water that only absorbs nothing takes a detour: a late gate gets the pulse's tail alone."""
    late = scene(0.42, albedo=0.0, gate={"delay": "30 ns", "width": "3 ns"})
    result = imclab.simulate(late, packets=1000, estimator="two-sided")
    assert result.total < 1e-25
    assert "comes back at" in result.notes[0]
    assert "nothing arrived" in result.notes[1]
    on_time = scene(0.42, albedo=0.0, gate={"center": "target", "width": "3 ns"})
    notes = imclab.simulate(on_time, packets=1000, estimator="two-sided").notes
    assert not any("nothing arrived" in note or "comes back" in note for note in notes)
