"""What comes out of a simulated generator: a virtual clock and the edges of its outputs."""

from __future__ import annotations

from typing import NamedTuple


class Edge(NamedTuple):
    """An output changes level at a time of the virtual clock."""

    time_ps: int
    output: str
    level: int


class PulseOutput(NamedTuple):
    """One output's pulse after a trigger: when it rises and falls, and its idle level."""

    output: str
    rise_ps: int
    fall_ps: int
    inverted: bool

    def edges(self, trigger_ps: int) -> list[Edge]:
        """Return the two edges of the pulse; none when it has no width."""
        if self.fall_ps <= self.rise_ps:
            return []
        active = 0 if self.inverted else 1
        return [
            Edge(trigger_ps + self.rise_ps, self.output, active),
            Edge(trigger_ps + self.fall_ps, self.output, 1 - active),
        ]
