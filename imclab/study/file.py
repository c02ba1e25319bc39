"""What a study file says: which scenes, which key varies over them, and what the paper printed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from imclab.errors import Fault, InputError
from imclab.scene import Detector, Scene, load_scene
from imclab.schema import Part, PositiveLength, read_toml, validate
from imclab.sweep import OneWay, Unit, parse_axis


class Effort(Part):
    """How long each scene runs: for a relative error, or for a number of packets."""

    rel_error: Annotated[float, Field(gt=0, lt=1)] | None = None
    packets: Annotated[float, Field(ge=1)] | None = None
    seed: Annotated[int, Field(ge=0)] = 1

    @model_validator(mode="after")
    def _one_limit(self) -> Self:
        if (self.rel_error is None) == (self.packets is None):
            raise ValueError("wanted either rel_error or packets")
        return self


class Curve(Part):
    """One line of the figure, or one row of pictures: a scene and what of it is changed."""

    name: Annotated[str, Field(min_length=1)]
    scene: str | None = None
    changes: dict[str, Any] = Field(default_factory=dict)
    without: tuple[str, ...] = ()
    run: Effort | None = None


class Vary(Part):
    """The key that runs along each curve; the first value is the reference."""

    key: str
    values: str
    label: str


class Printed(Part):
    """A row of one of the paper's tables."""

    curve: str
    source: str
    ssim: float
    mssim: float
    psnr_db: float


class Study(Part):
    """One result of the paper. Make it with `load_study`."""

    schema_version: Annotated[Literal[1], Field(alias="schema")]
    title: str
    shows: str
    kind: Literal["broadening", "echo", "pictures", "energy"]
    scene: str
    distances: tuple[PositiveLength, ...] = ()
    run: Effort
    vary: Vary | None = None
    curve: Annotated[tuple[Curve, ...], Field(min_length=1)]
    detector: Detector = Detector()
    printed: tuple[Printed, ...] = ()

    _name: str = PrivateAttr(default="")
    _units: tuple[Unit, ...] = PrivateAttr(default=())

    @property
    def name(self) -> str:
        """Name of the file without its ending."""
        return self._name

    @property
    def units(self) -> tuple[Unit, ...]:
        """What is run, curve by curve, the varied key running fastest."""
        return self._units

    @property
    def points(self) -> int:
        """How many units each curve has."""
        return len(self._units) // len(self.curve)


def load_study(path: str | Path) -> Study:
    """Read a study file and make its units.

    Every unit has a seed of its own, so that the errors of different points are independent.

    Raises
    ------
    InputError
        All faults of the file together; the faults of the scenes it makes.
    """
    path = Path(path)
    study = validate(Study, read_toml(path, "a study file"), str(path))
    study._name = path.stem
    values = (None,) if study.vary is None else parse_axis(f"{study.vary.key}={study.vary.values}").values
    one_way = OneWay(study.distances) if study.kind == "broadening" else None
    units: list[Unit] = []
    for curve in study.curve:
        base = load_scene(path.parent / (curve.scene or study.scene))
        for value in values:
            changes = curve.changes | dict.fromkeys(curve.without)
            if study.vary is not None:
                changes[study.vary.key] = value
            scene = _scene(base, changes, curve.run or study.run, len(units), f"{path}, curve {curve.name}")
            units.append(Unit(len(units), {"curve": curve.name} | changes, scene, one_way))
    study._units = tuple(units)
    return study


def _scene(base: Scene, changes: dict[str, Any], effort: Effort, index: int, source: str) -> Scene:
    run = {"seed": effort.seed + index}
    run |= {name: v for name in ("rel_error", "packets") if (v := getattr(effort, name)) is not None}
    try:
        return base.with_(**changes, run=run)
    except InputError as error:
        raise InputError(source, [replace(fault) for fault in error.faults]) from None


def studies_in(folder: str | Path) -> list[Path]:
    """Return the study files of a folder, in order of their names.

    Raises
    ------
    InputError
        When there is none.
    """
    found = sorted(Path(folder).glob("*.toml"))
    if not found:
        raise InputError(str(folder), [Fault("folder", "no *.toml file", "a folder of study files")])
    return found
