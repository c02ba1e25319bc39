"""The records of a study of pictures, curve by curve, and the optical depth of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from imclab.result import Flux, Result
from imclab.scene import Scene
from imclab.study.file import Study
from imclab.transport.media import water_of
from imclab.uncertainty import Estimate


@dataclass(frozen=True)
class Point:
    """One picture of a curve: its scene, and the value of the varied key as the file has it."""

    scene: Scene
    value: str
    result: Result

    @property
    def optical_depth(self) -> float:
        """Attenuation times the distance of the target."""
        return water_of(self.scene)[0].attenuation * self.scene.target.distance

    def energy(self, part: str = "total") -> Estimate:
        """Return a total of the picture with its standard error."""
        return Estimate(getattr(self.result, part), getattr(self.result, f"{part}_stderr"))


def curves_of(study: Study, records: Sequence[Result | Flux]) -> dict[str, list[Point]]:
    """Return the points of each curve, the reference first."""
    curves: dict[str, list[Point]] = {}
    for unit, record in zip(study.units, records, strict=True):
        assert isinstance(record, Result)
        value = "" if study.vary is None else str(unit.changes[study.vary.key])
        curves.setdefault(unit.changes["curve"], []).append(Point(unit.scene, value, record))
    return curves


def shown_value(study: Study, point: Point) -> str:
    """Return the varied value as people write it: an optical depth is a number, not an attenuation."""
    depth = study.vary is not None and study.vary.label == "optical depth"
    return f"{point.optical_depth:.2f}" if depth else point.value
