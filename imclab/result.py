"""What a simulation returns and how it is kept: energies with their standard errors, in HDF5."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imclab.errors import Fault, InputError
from imclab.files import written_whole

FloatArray = NDArray[np.float64]

_PICTURES = ("energy", "target", "backscatter")


def _freeze(record: Any) -> None:
    for item in fields(record):
        value = getattr(record, item.name)
        if isinstance(value, np.ndarray):
            array = np.ascontiguousarray(value, dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(record, item.name, array)


@dataclass(frozen=True, kw_only=True)
class Result:
    """A simulated picture: joules per pixel through the gate, with standard errors.

    Attributes
    ----------
    energy, energy_stderr : array (rows, columns)
        All light that arrives while the gate is open, J.
    target, backscatter : array (rows, columns)
        Its two parts: light that has touched the target, and light that has not; each with a
        ``_stderr``.
    total, total_stderr : float
        Energy of the whole picture, J. Its error is not the sum of the pixels' errors, which are
        correlated.
    target_total, backscatter_total : float
        The same of the two parts, each with a ``_stderr``.
    time_edges, time_energy, time_stderr : array (bins + 1), (bins), (bins), or None
        Light that arrives in each time bin before the gate acts, s and J.
    scene : str
        The whole scene as TOML.
    estimator, seed, packets, cpu_seconds, wall_seconds, threads
        How the numbers were made.
    notes : tuple of str
        What was left out of the run, and why; what a reader should know.
    """

    energy: FloatArray
    energy_stderr: FloatArray
    target: FloatArray
    target_stderr: FloatArray
    backscatter: FloatArray
    backscatter_stderr: FloatArray
    total: float
    total_stderr: float
    target_total: float
    target_total_stderr: float
    backscatter_total: float
    backscatter_total_stderr: float
    scene: str
    estimator: str
    seed: int
    packets: int
    cpu_seconds: float
    wall_seconds: float
    threads: int = 1
    time_edges: FloatArray | None = None
    time_energy: FloatArray | None = None
    time_stderr: FloatArray | None = None
    notes: tuple[str, ...] = ()
    interrupted: bool = False
    versions: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _freeze(self)

    @property
    def relative_error(self) -> float:
        """Relative standard error of the total; infinite when nothing arrived."""
        return self.total_stderr / self.total if self.total > 0 else float("inf")

    @property
    def pixel_error(self) -> float:
        """Relative standard error of the median pixel; infinite when nothing arrived."""
        lit = self.energy > 0.0
        return float(np.median(self.energy_stderr[lit] / self.energy[lit])) if lit.any() else float("inf")

    def without_pictures(self) -> Result:
        """Return the same numbers with empty pictures, for who keeps those elsewhere."""
        empty = np.empty((0, 0))
        parts = (part for name in _PICTURES for part in (name, f"{name}_stderr"))
        pictures: dict[str, Any] = dict.fromkeys(parts, empty)
        return replace(self, **pictures)

    def save(self, path: str | Path) -> None:
        """Write the result as one HDF5 file, whole or not at all."""
        import h5py

        with written_whole(path) as temporary, h5py.File(temporary, "w", track_order=True) as file:
            for name in _PICTURES:
                for part in (name, f"{name}_stderr"):
                    file.create_dataset(
                        f"image/{_dataset(part)}", data=getattr(self, part), compression="gzip", shuffle=True
                    )
                    file[f"image/{_dataset(part)}"].attrs["unit"] = "J"
            if self.time_edges is not None:
                for name, unit in (("edges", "s"), ("energy", "J"), ("stderr", "J")):
                    file[f"time/{name}"] = getattr(self, f"time_{name}")
                    file[f"time/{name}"].attrs["unit"] = unit
            write_attributes(file, self)

    @classmethod
    def load(cls, path: str | Path) -> Result:
        """Read a file written by `save`; `InputError` when it is not one."""
        with open_result(path, "image/energy") as file:
            values = read_attributes(file, cls)
            for name in _PICTURES:
                for part in (name, f"{name}_stderr"):
                    values[part] = file[f"image/{_dataset(part)}"][()]
            if "time" in file:
                for name in ("edges", "energy", "stderr"):
                    values[f"time_{name}"] = file[f"time/{name}"][()]
        return cls(**values)


@dataclass(frozen=True, kw_only=True)
class Flux:
    """One-way transmission: what crosses each plane, and how far beam and pulse have spread.

    Attributes
    ----------
    distances : array (planes)
        Where the planes stand, m.
    transmitted, reflected : array (planes)
        Shares of the pulse that cross the plane for the first time, and that leave the water at
        z = 0 as if it ended at the plane; each with a ``_stderr``.
    spot_fwhm, pulse_fwhm : array (planes)
        Full widths at half maximum of irradiance (m) and of power (s); each with a ``_stderr``.
    spot_rms, pulse_rms : array (planes)
        Root mean square radius (m) and standard deviation in time (s); each with a ``_stderr``.
    mean_path, reflected_mean_path : array (planes)
        Mean path length of the transmitted and of the reflected light, m; each with a ``_stderr``.
    absorbed, absorbed_stderr : float
        Share of the pulse that the water takes up before the last plane.
    """

    distances: FloatArray
    transmitted: FloatArray
    transmitted_stderr: FloatArray
    reflected: FloatArray
    reflected_stderr: FloatArray
    spot_fwhm: FloatArray
    spot_fwhm_stderr: FloatArray
    spot_rms: FloatArray
    spot_rms_stderr: FloatArray
    pulse_fwhm: FloatArray
    pulse_fwhm_stderr: FloatArray
    pulse_rms: FloatArray
    pulse_rms_stderr: FloatArray
    mean_path: FloatArray
    mean_path_stderr: FloatArray
    reflected_mean_path: FloatArray
    reflected_mean_path_stderr: FloatArray
    absorbed: float
    absorbed_stderr: float
    scene: str
    seed: int
    packets: int
    cpu_seconds: float
    wall_seconds: float
    threads: int = 1
    notes: tuple[str, ...] = ()
    interrupted: bool = False
    versions: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _freeze(self)

    def save(self, path: str | Path) -> None:
        """Write the result as one HDF5 file, whole or not at all."""
        import h5py

        with written_whole(path) as temporary, h5py.File(temporary, "w", track_order=True) as file:
            for item in fields(self):
                value = getattr(self, item.name)
                if isinstance(value, np.ndarray):
                    file[f"planes/{item.name}"] = value
            write_attributes(file, self)

    @classmethod
    def load(cls, path: str | Path) -> Flux:
        """Read a file written by `save`; `InputError` when it is not one."""
        with open_result(path, "planes/transmitted") as file:
            values = read_attributes(file, cls)
            values |= {name: data[()] for name, data in file["planes"].items()}
        return cls(**values)


def _dataset(part: str) -> str:
    return "stderr" if part == "energy_stderr" else part


def write_attributes(file: Any, record: Any) -> None:
    """Write every field of ``record`` that is no array as an attribute of an HDF5 file."""
    for item in fields(record):
        value = getattr(record, item.name)
        if value is None or isinstance(value, np.ndarray):
            continue
        structured = isinstance(value, (Mapping, tuple))
        file.attrs[item.name] = json.dumps(value, sort_keys=True) if structured else value


def read_attributes(file: Any, cls: type) -> dict[str, Any]:
    """Return what `write_attributes` wrote, with the types that ``cls`` wants."""
    values: dict[str, Any] = {}
    for item in fields(cls):
        if item.name not in file.attrs:
            continue
        value = file.attrs[item.name]
        if item.name in ("versions", "notes"):
            value = json.loads(value)
            value = tuple(value) if isinstance(value, list) else value
        values[item.name] = value.item() if hasattr(value, "item") else value
    return values


def open_result(path: str | Path, dataset: str) -> Any:
    """Open an HDF5 file that holds ``dataset``; anything else is an `InputError`."""
    import h5py

    path = Path(path)
    if not path.is_file():
        raise InputError(str(path), [Fault("file", "no such file", "a result file")])
    try:
        file = h5py.File(path, "r")
    except OSError:
        raise InputError(str(path), [Fault("file", "no HDF5 file", "a result file")]) from None
    if dataset not in file:
        file.close()
        raise InputError(str(path), [Fault("file", f"no dataset {dataset}", "a result of this kind")])
    return file
