"""The virtual rig's camera: a detector chain whose gain curve and pixels are not ideal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imclab.detector import IntensifiedCamera

Energies = NDArray[np.float64]


@dataclass(frozen=True)
class VirtualCamera:
    """The camera of the twin: a detector chain, its gain curve, and pixels that are not all alike."""

    chain: IntensifiedCamera
    reference_setting: float
    flat: Energies
    dead: NDArray[np.bool_]
    hot: NDArray[np.bool_]

    def gain_ratio(self, setting: float) -> float:
        """Gain at ``setting`` over the gain at the reference: a power law with a 2 % wiggle."""
        ratio = (setting / self.reference_setting) ** 18.0
        return float(ratio * (1.0 + 0.02 * np.sin((setting - self.reference_setting) / 9.0)))

    def frame(self, energy: Energies, setting: float, rng: np.random.Generator) -> NDArray[np.uint16]:
        """Return one frame of ``energy`` (J per pixel) at a gain setting."""
        chain = replace(self.chain, gain=self.chain.gain * self.gain_ratio(setting))
        counts = chain.draw(energy * self.flat, rng).astype(np.int64)
        counts[self.hot] += self.chain.full_scale // 4
        counts[self.dead] = round(self.chain.dark_counts)
        return np.clip(counts, 0, self.chain.full_scale).astype(np.uint16)

    def levels(self, setting: float, shares: Iterable[float]) -> list[float]:
        """Energies per pixel (J) whose signal would be these shares of full scale without any bend."""
        per_joule = float(self.chain.photoelectrons(1.0)) * self.chain.gain * self.gain_ratio(setting)
        return [float(share) * self.chain.full_scale / per_joule for share in shares]

    def truth(self, settings: Sequence[float]) -> dict[str, Any]:
        """What a calibration should find, as plain numbers."""
        chain = self.chain
        lowest = min(settings)
        ratios = {f"{s:g}": self.gain_ratio(s) / self.gain_ratio(lowest) for s in sorted(set(settings))}
        return {
            "relative_gain": ratios,
            "reference_gain": lowest,
            "quantum_efficiency": chain.quantum_efficiency,
            "excess_noise_factor": chain.excess_noise_factor,
            "blur_fwhm_px": chain.blur_fwhm_px,
            "halo_fwhm_px": chain.halo_fwhm_px,
            "halo_share": chain.halo_share,
            "dark_counts": chain.dark_counts,
            "read_noise_counts": chain.read_noise_counts,
            "response_exponent": chain.response_exponent,
            "knee_counts": chain.knee_counts,
            "counts_per_electron": chain.gain,
            "flat_sd": float(self.flat.std()),
            "dead_pixels": np.argwhere(self.dead).tolist(),
            "hot_pixels": np.argwhere(self.hot).tolist(),
        }


def choose_camera(
    bright: Mapping[str, float], *, wavelength: float, shape: tuple[int, int], rng: np.random.Generator
) -> tuple[VirtualCamera, dict[str, float]]:
    """Choose a camera whose lowest gain suits the brightest picture, and a gain for each condition.

    Parameters
    ----------
    bright : mapping
        Energy (J) of a bright camera pixel in each condition.
    shape : (rows, columns)
        Of the camera.
    """
    chain = IntensifiedCamera(
        wavelength=wavelength,
        quantum_efficiency=0.2,
        excess_noise_factor=1.6,
        blur_fwhm_px=1.6,
        halo_fwhm_px=9.0,
        halo_share=0.06,
        dark_counts=96.0,
        read_noise_counts=2.2,
        response_exponent=0.92,
        knee_counts=2900.0,
        bit_depth=12,
    )
    chain = replace(chain, gain=0.5 * chain.full_scale / float(chain.photoelectrons(max(bright.values()))))
    flat = 1.0 + 0.015 * rng.standard_normal(shape)
    defects = rng.random(shape)
    camera = VirtualCamera(chain, 700.0, flat, defects < 3e-4, defects > 1 - 3e-4)
    offered = np.arange(700.0, 900.0, 5.0)
    gains = np.array([camera.gain_ratio(setting) for setting in offered])
    wanted = {name: max(bright.values()) / level for name, level in bright.items()}
    return camera, {name: float(offered[np.argmin(abs(gains - w))]) for name, w in wanted.items()}
