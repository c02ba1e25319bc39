"""A scene: water, laser, target, receiver and gate, read from a TOML file and frozen.

Everything a user can say about the rig stands here, checked once; every other module trusts it.
Axes, origin and signs are those of `docs/conventions.md`.
"""

from __future__ import annotations

import copy
import io
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import tomli_w
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, model_validator

from imclab.errors import Fault, InputError
from imclab.materials import Material
from imclab.media import Medium
from imclab.schema import (
    Angle,
    Energy,
    Length,
    Part,
    PositiveLength,
    PositiveTime,
    Time,
    read_toml,
    validate,
)


class Laser(Part):
    """Pulsed Gaussian beam that enters the water at the origin along +z (eqs. 1, 2)."""

    wavelength: PositiveLength
    pulse_energy: Energy
    pulse_fwhm: PositiveTime
    divergence_fwhm: Angle
    spot_fwhm: PositiveLength
    divergence_measured_in: Literal["water", "air"] = "water"


class Target(Part):
    """A rectangle in the plane z = distance with a figure and a ground of different materials."""

    distance: PositiveLength
    width: PositiveLength
    height: PositiveLength
    mask: str | None = None
    figure: Material
    ground: Material | None = None

    @model_validator(mode="after")
    def _mask_needs_ground(self) -> Self:
        if self.mask is not None and self.ground is None:
            raise ValueError("wanted [target.ground] beside mask: white is figure, black is ground")
        return self


class Receiver(Part):
    """A disc aperture facing +z with an ideal lens focused on the target (eq. 14)."""

    position: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    aperture_radius: PositiveLength
    field_of_view: Annotated[Angle, Field(le=np.pi + 1e-12)] = float(np.pi)
    pixels: tuple[Annotated[int, Field(ge=1, le=8192)], Annotated[int, Field(ge=1, le=8192)]]


class Gate(Part):
    """When the intensifier is on: it opens at ``delay``, or is centred on the target's return."""

    delay: Time | None = None
    center: Literal["target"] | None = None
    width: PositiveTime
    rise: Annotated[Time, Field(ge=0)] = 0.0

    @model_validator(mode="after")
    def _one_position(self) -> Self:
        if (self.delay is None) == (self.center is None):
            raise ValueError('wanted either delay = "7.44 ns" or center = "target"')
        return self


class Detector(Part):
    """The camera as a chain from energy to counts; or the name of a calibration file."""

    calibration: str | None = None
    quantum_efficiency: Annotated[float, Field(gt=0, le=1)] = 0.2
    gain: Annotated[float, Field(gt=0)] = 1.0
    excess_noise_factor: Annotated[float, Field(ge=1)] = 1.0
    blur_fwhm_px: Annotated[float, Field(ge=0)] = 0.0
    counts_per_electron: Annotated[float, Field(gt=0)] = 1.0
    dark_counts: Annotated[float, Field(ge=0)] = 0.0
    read_noise_counts: Annotated[float, Field(ge=0)] = 0.0
    response_exponent: Annotated[float, Field(gt=0)] = 1.0
    bit_depth: Annotated[int, Field(ge=8, le=16)] = 12
    protection_threshold: Energy | None = None


class Run(Part):
    """How long a simulation runs when neither the call nor the command says so."""

    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    rel_error: Annotated[float, Field(gt=0, lt=1)] | None = None
    seconds: Annotated[float, Field(gt=0)] | None = None
    packets: Annotated[float, Field(ge=1)] | None = None
    estimator: Literal["auto", "analog", "expected", "two-sided"] = "auto"

    @model_validator(mode="after")
    def _one_budget(self) -> Self:
        if sum(value is not None for value in (self.rel_error, self.seconds, self.packets)) > 1:
            raise ValueError("wanted only one of rel_error, seconds, packets")
        return self


class Scene(Part):
    """One arrangement of the rig. Make it with `load_scene` or `Scene.from_document`."""

    schema_version: Annotated[Literal[1], Field(alias="schema")]
    title: str = ""
    medium: Medium
    laser: Laser
    target: Target
    receiver: Receiver
    gate: Gate | None = None
    detector: Detector | None = None
    run: Run = Run()

    _document: dict[str, Any] = PrivateAttr(default_factory=dict)
    _folder: Path = PrivateAttr(default=Path())

    @classmethod
    def from_document(
        cls, document: Mapping[str, Any], *, folder: str | Path = ".", source: str = "scene"
    ) -> Scene:
        """Check ``document`` (what a scene file holds) and return the scene.

        Parameters
        ----------
        document : mapping
            Nested tables as TOML gives them.
        folder : path
            Where relative names such as the mask are looked for.
        source : str
            What to call the document in errors.

        Raises
        ------
        InputError
            With every fault and its dotted path.
        """
        scene = validate(cls, document, source)
        scene._document = copy.deepcopy(dict(document))
        scene._folder = Path(folder)
        _check_files(scene, source)
        return scene

    @property
    def toml(self) -> str:
        """The whole scene as TOML text."""
        return tomli_w.dumps(self._document)

    @property
    def document(self) -> dict[str, Any]:
        """The nested tables the scene was made from, a copy."""
        return copy.deepcopy(self._document)

    @property
    def folder(self) -> Path:
        """Where the names of files in this scene are looked for."""
        return self._folder

    def with_(self, **changes: Any) -> Scene:
        """Return a scene with some keys changed: ``scene.with_(**{"medium.attenuation": "1.42 1/m"})``.

        A value of ``None`` removes the key. Raises `InputError` as `load_scene` does.
        """
        document = copy.deepcopy(self._document)
        for dotted, value in changes.items():
            *tables, key = dotted.split(".")
            place = document
            for table in tables:
                place = place.setdefault(table, {})
                if not isinstance(place, dict):
                    fault = Fault(dotted, "a path through a value", "a path through tables")
                    raise InputError("changed scene", [fault])
            if value is None:
                place.pop(key, None)
            else:
                place[key] = value
        return Scene.from_document(document, folder=self._folder, source="changed scene")

    @cached_property
    def figure_mask(self) -> NDArray[np.bool_]:
        """Which part of the target is figure, shape (mask rows, mask columns); (1, 1) without a mask."""
        if self.target.mask is None:
            mask = np.ones((1, 1), dtype=bool)
        else:
            mask = _read_mask(self._folder / self.target.mask)
        mask.setflags(write=False)
        return mask


def load_scene(path: str | Path) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path : path
        A TOML file as described in `docs/scene.md`.

    Raises
    ------
    InputError
        When the file is missing, no TOML, or wrong in one or several keys; all faults together.
    """
    path = Path(path)
    document = read_toml(path, "a scene file")
    return Scene.from_document(document, folder=path.parent, source=str(path))


def _check_files(scene: Scene, source: str) -> None:
    if scene.target.mask is None:
        return
    try:
        scene.figure_mask  # noqa: B018  read now, so that a bad mask is told with the scene
    except (OSError, ValueError) as error:
        came = f'"{scene.target.mask}" ({error})'
        wanted = "a black and white picture: PNG or TIFF, one channel or grey, two values"
        raise InputError(source, [Fault("target.mask", came, wanted)]) from None


def _read_mask(path: Path) -> NDArray[np.bool_]:
    if not path.is_file():
        raise FileNotFoundError("a folder, not a picture" if path.is_dir() else "no such file")
    from skimage.io import imread

    try:
        picture = np.asarray(imread(io.BytesIO(path.read_bytes())))
    except Exception as error:  # each picture format has its own errors for a damaged file
        raise ValueError("not a picture that can be read") from error
    if picture.ndim == 3 and picture.shape[2] in (3, 4):
        colours = picture[..., :3]
        if np.ptp(colours, axis=2).max() != 0:
            raise ValueError("coloured")
        picture = colours[..., 0]
    if picture.ndim != 2:
        raise ValueError(f"{picture.ndim} dimensions")
    if picture.dtype != bool:
        levels = np.unique(picture)
        if len(levels) > 2:
            raise ValueError(f"{len(levels)} grey levels")
        # Two levels: the brighter is white. One alone: all figure unless it is black.
        picture = picture > (levels[0] if len(levels) == 2 else 0)
    return np.ascontiguousarray(picture)
