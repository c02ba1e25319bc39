"""The intensified camera as a chain: energy -> photoelectrons -> intensifier -> phosphor -> counts.

This is the forward model with physical parameters. It shares nothing with the package `calibration`,
which learns the same chain from frames; a virtual rig drawn with this model therefore tests it.

Symbols: F² excess noise factor of the micro-channel plate; a single photoelectron releases a random
number of photons on the phosphor, gamma distributed with mean G and variance (F² - 1) G².
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.constants import c, h
from scipy.ndimage import gaussian_filter

from imclab.errors import ImclabError

FWHM_PER_SIGMA = 2.0 * math.sqrt(2.0 * math.log(2.0))


class ProtectionTrippedError(ImclabError, RuntimeError):
    """The light exceeds the intensifier's threshold: its protection shuts the picture off."""


@dataclass(frozen=True, kw_only=True)
class IntensifiedCamera:
    """Parameters of the chain; see `expected_counts` and `draw`.

    Attributes
    ----------
    wavelength : float
        Vacuum wavelength, m.
    quantum_efficiency : float
        Photoelectrons per photon.
    gain : float
        Counts that one photoelectron gives in the linear range, at this gain setting.
    excess_noise_factor : float
        F² >= 1 of the multiplication.
    blur_fwhm_px, halo_fwhm_px, halo_share : float
        Point spread of phosphor and fibres: a Gaussian core and a wide halo with a share of the light.
    dark_counts, read_noise_counts : float
        Offset and standard deviation of the sensor.
    response_exponent, knee_counts : float
        Response counts = signal**exponent, bent towards saturation above the knee (infinite: no bend).
        The exponent acts on the signal as a share of full scale.
    bit_depth : int
        8 to 16.
    protection_threshold : float or None
        Energy of the whole picture, J, above which the intensifier shuts off.
    """

    wavelength: float
    quantum_efficiency: float = 0.2
    gain: float = 1.0
    excess_noise_factor: float = 1.0
    blur_fwhm_px: float = 0.0
    halo_fwhm_px: float = 0.0
    halo_share: float = 0.0
    dark_counts: float = 0.0
    read_noise_counts: float = 0.0
    response_exponent: float = 1.0
    knee_counts: float = np.inf
    bit_depth: int = 12
    protection_threshold: float | None = None

    @property
    def full_scale(self) -> int:
        """Largest count."""
        return int(2**self.bit_depth - 1)

    def photoelectrons(self, energy: ArrayLike) -> NDArray[np.float64]:
        """Mean number of photoelectrons from ``energy`` (J per pixel)."""
        electrons_per_joule = self.quantum_efficiency * self.wavelength / (h * c)
        return np.asarray(np.asarray(energy, dtype=np.float64) * electrons_per_joule)

    def expected_counts(self, energy: ArrayLike) -> NDArray[np.float64]:
        """Return the counts without noise and rounding for a picture of energies (J per pixel).

        Raises
        ------
        ProtectionTrippedError
            When the picture's energy exceeds the protection threshold.
        """
        self._check_protection(energy)
        return self._respond(self._spread(self.photoelectrons(energy) * self.gain))

    def draw(self, energy: ArrayLike, rng: np.random.Generator) -> NDArray[np.uint16]:
        """Return one noisy frame, as the camera would deliver it (unsigned, ``bit_depth`` bits).

        Parameters
        ----------
        energy : array (rows, columns)
            J per pixel at the photocathode.
        rng : numpy.random.Generator
        """
        self._check_protection(energy)
        electrons = rng.poisson(self.photoelectrons(energy)).astype(float)
        spread = self.excess_noise_factor - 1.0
        if spread > 0:
            # n photoelectrons release the sum of n gamma numbers, which is gamma again.
            electrons = rng.gamma(np.maximum(electrons, 1e-12) / spread, spread)
        counts = self._respond(self._spread(electrons * self.gain))
        counts = counts + rng.normal(0.0, self.read_noise_counts, counts.shape)
        return np.clip(np.rint(counts), 0, self.full_scale).astype(np.uint16)

    def _check_protection(self, energy: ArrayLike) -> None:
        total = float(np.sum(energy))
        if self.protection_threshold is not None and total > self.protection_threshold:
            raise ProtectionTrippedError(
                f"the picture carries {total:.3g} J, the intensifier's protection acts above "
                f"{self.protection_threshold:.3g} J: no picture. Lower the light or open the gate later."
            )

    def _spread(self, picture: NDArray[np.float64]) -> NDArray[np.float64]:
        core = _blurred(picture, self.blur_fwhm_px)
        if self.halo_share == 0.0:
            return core
        return (1.0 - self.halo_share) * core + self.halo_share * _blurred(picture, self.halo_fwhm_px)

    def _respond(self, signal: NDArray[np.float64]) -> NDArray[np.float64]:
        full = float(self.full_scale)
        counts = full * (np.maximum(signal, 0.0) / full) ** self.response_exponent
        if np.isfinite(self.knee_counts):
            room = full - self.knee_counts
            above = np.maximum(counts - self.knee_counts, 0.0)
            counts = np.minimum(counts, self.knee_counts) + room * (1.0 - np.exp(-above / room))
        return counts + self.dark_counts


def _blurred(picture: NDArray[np.float64], fwhm_px: float) -> NDArray[np.float64]:
    if fwhm_px == 0.0:
        return picture
    # Beyond the sensor the scene goes on: what leaves over the edge comes in from the neighbours.
    return np.asarray(gaussian_filter(picture, fwhm_px / FWHM_PER_SIGMA, mode="nearest", truncate=5.0))
