"""A calibration on disk: one HDF5 file, written whole or not at all, with a digest of its contents."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calibration.curve import Response
from calibration.errors import StoredFileError
from calibration.model import Calibration
from calibration.setting import Figure, Setting
from calibration.setup import Setup

FORMAT = "imclab camera calibration"
VERSION = 1


def save(camera: Calibration, path: Path) -> None:
    """Write ``camera`` to ``path`` under a temporary name, then put it in place."""
    if not path.parent.is_dir():
        raise StoredFileError(f"{path}: the folder {path.parent} does not exist. Make it, or name another.")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with h5py.File(temporary, "w") as file:
            _write(camera, file)
            file.attrs["digest"] = _digest(file)
        temporary.replace(path)
    except OSError as error:
        raise StoredFileError(
            f"{path}: cannot be written ({error.strerror or error}). "
            "Name a file in a folder that exists and may be written to."
        ) from None
    finally:
        temporary.unlink(missing_ok=True)


def load(path: str | Path) -> Calibration:
    """Read a calibration written by :meth:`Calibration.save`.

    Raises
    ------
    StoredFileError
        When the file is not a calibration, of a later version, cut short or altered.
    """
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != FORMAT:
                raise StoredFileError(
                    f"{path}: an HDF5 file that is not a calibration; wanted one that "
                    "`imclab calibrate` wrote"
                )
            if int(file.attrs["version"]) > VERSION:
                raise StoredFileError(
                    f"{path}: calibration version {file.attrs['version']}; this program reads "
                    f"up to {VERSION}. Use a newer imclab."
                )
            if file.attrs["digest"] != _digest(file):
                raise StoredFileError(
                    f"{path}: the contents do not fit their digest; the file was altered or "
                    "damaged. Calibrate again, or take the original."
                )
            return _read(file)
    except FileNotFoundError:
        raise StoredFileError(
            f"{path}: no such file; wanted a calibration (`imclab calibrate FOLDER -o camera.h5` makes one)"
        ) from None
    except (OSError, KeyError) as error:
        raise StoredFileError(f"{path}: not a whole calibration file ({error}). Calibrate again.") from None


def _write(camera: Calibration, file: h5py.File) -> None:
    setup = asdict(camera.setup) | {
        "known_gain": {str(key): gain for key, gain in camera.setup.known_gain.items()}
    }
    file.attrs.update(
        {
            "format": FORMAT,
            "version": VERSION,
            "reference_gain": camera.reference_gain,
            "saturation_counts": camera.saturation_counts,
            "unit": camera.unit,
        }
    )
    # As data, not attributes: HDF5 holds no attribute above 64 kB, and 500 file digests pass that.
    texts = {
        "setup": setup,
        "notes": camera.notes,
        "provenance": dict(camera.provenance),
        "figures": [tuple(figure) for figure in camera.figures],
    }
    for name, content in texts.items():
        file[f"text/{name}"] = json.dumps(content)
    response = file.create_group("response")
    response["log_counts"] = camera.response.log_counts
    response["log_exposure"] = camera.response.log_exposure
    response["covariance"] = camera.covariance
    response.attrs["limit"] = camera.response.limit
    counts, exposure = camera.response.table
    response["table_counts"], response["table_exposure"] = counts, exposure
    gain = file.create_group("gain")
    gain["setting"], gain["log_gain"] = np.array(camera.gains), camera.log_gain
    file.create_dataset("defects", data=camera.defects, compression="gzip", compression_opts=1)
    stored: dict[int, h5py.Dataset] = {}
    for index, setting in enumerate(camera.settings):
        group = file.create_group(f"settings/{index:03d}")
        for name in ("dark", "flat"):
            pixels = getattr(setting, name)
            if id(pixels) in stored:  # settings without frames of their own share a map
                group[name] = stored[id(pixels)]
            else:
                group.create_dataset(name, data=pixels, compression="gzip", compression_opts=1, shuffle=True)
                stored[id(pixels)] = group[name]
        group["correlation"] = setting.correlation
        for name in ("dark_stderr", "flat_stderr", "read_variance", "shot"):
            group.attrs[name] = getattr(setting, name)
    for name, column in camera.tables.items():
        file[f"tables/{name}"] = column


def _read(file: h5py.File) -> Calibration:
    texts = {name: json.loads(item.asstr()[()]) for name, item in file["text"].items()}
    fields = texts["setup"]
    fields["known_gain"] = {float(key): gain for key, gain in fields["known_gain"].items()}
    maps: dict[Any, Any] = {}

    def pixels(dataset: h5py.Dataset) -> Any:
        key = h5py.h5o.get_info(dataset.id).addr
        if key not in maps:
            maps[key] = _frozen(dataset[:])
        return maps[key]

    settings = tuple(
        Setting(
            dark=pixels(group["dark"]),
            flat=pixels(group["flat"]),
            correlation=_frozen(group["correlation"][:]),
            **{
                name: float(group.attrs[name])
                for name in ("dark_stderr", "flat_stderr", "read_variance", "shot")
            },
        )
        for _, group in sorted(file["settings"].items())
    )
    response = file["response"]
    return Calibration(
        setup=Setup(**fields),
        response=Response(
            _frozen(response["log_counts"][:]),
            _frozen(response["log_exposure"][:]),
            float(response.attrs["limit"]),
        ),
        gains=tuple(float(setting) for setting in file["gain/setting"][:]),
        reference_gain=float(file.attrs["reference_gain"]),
        log_gain=_frozen(file["gain/log_gain"][:]),
        covariance=_frozen(response["covariance"][:]),
        settings=settings,
        defects=_frozen(file["defects"][:]),
        saturation_counts=float(file.attrs["saturation_counts"]),
        unit=str(file.attrs["unit"]),
        figures=tuple(Figure(*figure) for figure in texts["figures"]),
        tables=_tables(file),
        notes=tuple(texts["notes"]),
        provenance={**texts["provenance"], "digest": str(file.attrs["digest"])},
    )


def _tables(file: h5py.File) -> Mapping[str, Any]:
    if "tables" not in file:
        return {}
    return {name: _frozen(column[:]) for name, column in file["tables"].items()}


def _frozen(array: Any) -> Any:
    array.flags.writeable = False
    return array


def _digest(file: h5py.File) -> str:
    """SHA-256 over names, attributes and numbers in a fixed order (not over HDF5's own bookkeeping)."""
    total = hashlib.sha256()
    for piece in _pieces(file):
        total.update(piece)
    return total.hexdigest()


def _pieces(group: h5py.Group) -> Iterator[bytes]:
    for name in sorted(group.attrs):
        if name != "digest":
            yield f"{group.name}@{name}={group.attrs[name]}".encode()
    for name in sorted(group):
        item = group[name]
        if isinstance(item, h5py.Group):
            yield from _pieces(item)
        else:
            yield f"{item.name}:{item.shape}:{item.dtype}".encode()
            content = item[()]
            yield content if isinstance(content, bytes) else np.ascontiguousarray(content).tobytes()
