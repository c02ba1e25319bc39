"""How scene and experiment files are checked: quantities with units, and all faults in one message."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from imclab import units
from imclab.errors import Fault, InputError


class Part(BaseModel):
    """A frozen piece of a file that refuses keys it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def _quantity(kind: str) -> Callable[[Any], float]:
    def convert(value: Any) -> float:
        try:
            return units.parse(value, kind)
        except units.UnitError as error:
            raise PydanticCustomError("quantity", "{problem}", {"problem": str(error)}) from None

    return convert


Length = Annotated[float, BeforeValidator(_quantity("length"))]
PositiveLength = Annotated[Length, Field(gt=0)]
Time = Annotated[float, BeforeValidator(_quantity("time"))]
PositiveTime = Annotated[Time, Field(gt=0)]
Attenuation = Annotated[float, BeforeValidator(_quantity("attenuation")), Field(ge=0)]
Angle = Annotated[float, BeforeValidator(_quantity("angle")), Field(gt=0)]
Energy = Annotated[float, BeforeValidator(_quantity("energy")), Field(gt=0)]
Density = Annotated[float, BeforeValidator(_quantity("density")), Field(gt=0)]
NumberDensity = Annotated[float, BeforeValidator(_quantity("number_density")), Field(gt=0)]
Temperature = Annotated[float, BeforeValidator(_quantity("temperature"))]
Salinity = Annotated[float, BeforeValidator(_quantity("salinity")), Field(ge=0)]


def _complex_index(value: Any) -> complex:
    """Read ``1.59``, ``[0.054, 3.43]`` or ``"0.054 - 3.43i"`` as n - ik with k >= 0."""
    try:
        if isinstance(value, str):
            number = complex(value.replace(" ", "").replace("i", "j"))
        elif isinstance(value, (list, tuple)):
            real, imaginary = value
            number = complex(real, imaginary)
        else:
            number = complex(value)
    except (TypeError, ValueError):
        number = 0j
    if not number.real > 0 or abs(number) == float("inf"):
        raise PydanticCustomError("index", 'wanted an index such as 1.59, [1.88, 3.49] or "1.88 - 3.49i"')
    return complex(number.real, -abs(number.imag))


ComplexIndex = Annotated[complex, BeforeValidator(_complex_index)]

Model = TypeVar("Model", bound=BaseModel)


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Read a TOML file; a missing file and a broken line are told as faults."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        faults = [Fault("file", "no such file", what, "Check the path.")]
    except IsADirectoryError:
        faults = [Fault("file", "a folder", what, "Name the TOML file in it.")]
    except (PermissionError, UnicodeDecodeError) as error:
        came = "no permission to read" if isinstance(error, PermissionError) else "no UTF-8 text"
        faults = [Fault("file", came, what)]
    except tomllib.TOMLDecodeError as error:
        faults = [Fault("file", str(error), "valid TOML", "Text values need quotes.")]
    raise InputError(str(path), faults)


def validate(model: type[Model], document: Mapping[str, Any], source: str) -> Model:
    """Build ``model`` from ``document`` or raise one `InputError` that lists every fault.

    Parameters
    ----------
    model : subclass of pydantic.BaseModel
    document : mapping
        What the file held.
    source : str
        Name of the file, for the message.
    """
    try:
        return model.model_validate(document)
    except ValidationError as error:
        details = error.errors(include_url=False)
        # A list whose items are at fault is not too short as well, though pydantic says so.
        faulty = {detail["loc"][0] for detail in details if len(detail["loc"]) > 1}
        faults = [
            _fault(detail, model)
            for detail in details
            if detail["type"] != "too_short" or detail["loc"][0] not in faulty or len(detail["loc"]) > 1
        ]
        raise InputError(source, sorted(faults, key=lambda fault: fault.where)) from None


def _fault(detail: ErrorDetails, model: type[BaseModel]) -> Fault:
    path, parent = _walk(detail["loc"], model)
    where = ".".join(path) or "file"
    kind, context = detail["type"], detail.get("ctx", {})
    if kind == "extra_forbidden":
        return _unknown_key(where, path[-1], parent)
    if kind == "missing":
        return Fault(where, "nothing", "a value", "Add this key.")
    if kind.startswith("union_tag"):
        tag = context.get("tag")
        wanted = context.get("expected_tags", "a kind")
        near = difflib.get_close_matches(str(tag), wanted.replace("'", "").split(", "), n=1, cutoff=0.4)
        came = "nothing" if tag is None else f'"{tag}"'
        return Fault(f"{where}.kind", came, f"one of {wanted}", f'Did you mean "{near[0]}"?' if near else "")
    message = detail["msg"].removeprefix("Value error, ")
    wanted = message.removeprefix("wanted ") if message.startswith("wanted ") else _plain(message)
    return Fault(where, _shown(detail["input"]), wanted)


def _plain(message: str) -> str:
    for start in ("Input should be ", "String should ", "List should "):
        if message.startswith(start):
            return message.removeprefix(start)
    return message[:1].lower() + message[1:]


def _shown(value: Any) -> str:
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _unknown_key(where: str, name: str, parent: type[BaseModel] | None) -> Fault:
    known = sorted(field.alias or key for key, field in parent.model_fields.items()) if parent else []
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    advice = f'Did you mean "{near[0]}"?' if near else "Remove it."
    return Fault(where, "an unknown key", f"one of {', '.join(known)}" if known else "a known key", advice)


def _walk(location: Iterable[int | str], model: type[BaseModel]) -> tuple[list[str], type[BaseModel] | None]:
    """Follow pydantic's location through the models; drop the tags of unions, which no file contains."""
    path: list[str] = []
    here: list[type[BaseModel]] = [model]
    for step in location:
        if isinstance(step, int):
            path[-1:] = [f"{path[-1]}[{step}]"]
            continue
        fields = [part.model_fields[step] for part in here if step in part.model_fields]
        tagged = [part for part in here if step in _tags(part)]
        if not fields and tagged and len(here) > 1:
            here = tagged
            continue
        path.append(step)
        if fields:
            here = [part for field in fields for part in _models_in(field.annotation)] or here
    return path, here[0] if here else None


def _tags(part: type[BaseModel]) -> tuple[Any, ...]:
    field = part.model_fields.get("kind")
    return get_args(field.annotation) if field else ()


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for inner in get_args(annotation) for found in _models_in(inner)]
