"""The calibration of one camera: counts to energy and back, with uncertainties."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from calibration.curve import Response
from calibration.errors import ShapeError
from calibration.gain import GainLaw, GainTable
from calibration.noise import spreading_kernel
from calibration.response import rising
from calibration.setting import Figure, Flag, Setting
from calibration.setup import Setup

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Calibration:
    """A calibrated camera; made by :func:`calibration.calibrate` or :func:`calibration.load`.

    Attributes
    ----------
    setup : Setup
        What ``camera.toml`` said.
    response : Response
        Counts above dark against exposure.
    gains : tuple of float
        The settings that were calibrated, rising.
    reference_gain : float
        The setting with relative gain 1.
    log_gain : Floats
        Logarithm of the relative gain at ``gains``.
    covariance : Floats
        Of (log exposure at the response's nodes, log gain), statistical.
    settings : tuple of Setting
        Pixel maps and noise at ``gains``.
    defects : array of uint8
        Why pixels are bad (``correct.Defect``); 0 is good.
    saturation_counts : float
        Raw counts from which a pixel is saturated.
    unit : str
        Unit of energy: "J", or "relative" where only ratios were known.
    figures : tuple of Figure
        Figures of merit.
    tables : mapping
        The points behind the curves (runs, their means, noise and residuals), for reports.
    notes : tuple of str
        What the user should know: what was left out, or filled in.
    provenance : mapping
        Where it came from.
    """

    setup: Setup
    response: Response
    gains: tuple[float, ...]
    reference_gain: float
    log_gain: Floats
    covariance: Floats
    settings: tuple[Setting, ...]
    defects: NDArray[np.uint8]
    saturation_counts: float
    unit: str
    figures: tuple[Figure, ...] = ()
    tables: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    wiggle_draw: float = 0.0

    @property
    def bit_depth(self) -> int:
        """Bits of the digitiser."""
        return self.setup.bit_depth

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the sensor."""
        return self.defects.shape[0], self.defects.shape[1]

    @property
    def bad_pixels(self) -> NDArray[np.bool_]:
        """Pixels that give no energy."""
        return np.asarray(self.defects != 0)

    @cached_property
    def _gain_table(self) -> GainTable:
        nodes = self.response.log_counts.size
        return GainTable(self.gains, self.log_gain, self.covariance[nodes:, nodes:], self.wiggle_draw)

    @property
    def gain_law(self) -> GainLaw | None:
        """The law that describes the measured gains best; None with fewer than 3 settings."""
        return self._gain_table.law

    def relative_gain(self, gain: float) -> tuple[float, float]:
        """Gain relative to the reference setting, and its standard error.

        Parameters
        ----------
        gain : float
            A calibrated setting; or one between two of them, where a law describes the measured
            gains (``gain_law.supported``); its misfit is then part of the error.

        Raises
        ------
        SettingError
            For any other setting, naming those there are.
        """
        found = self._gain_table.at(gain)
        value = float(np.exp(found.log_gain))
        return value, value * float(np.sqrt(found.variance))

    def setting(self, gain: float) -> Setting:
        """Pixel maps and noise at a setting; between two settings the mean by distance.

        Raises
        ------
        SettingError
            As :meth:`relative_gain`.
        """
        found = self._gain_table.at(gain)
        low, high = found.neighbours
        return (
            self.settings[low]
            if low == high
            else self.settings[low].mixed_with(self.settings[high], found.share)
        )

    def _maps(self, shape: tuple[int, ...], gain: float, *, typical: bool) -> tuple[Setting, Any, Any, Any]:
        """Give the setting with its dark, flat and good-pixel maps, or single numbers for a typical pixel."""
        setting = self.setting(gain)
        if typical or len(shape) < 2:
            good = ~self.bad_pixels
            return setting, float(np.median(setting.dark[good])), 1.0, True
        if shape[-2:] != self.shape or len(shape) > 3:
            rows, columns = self.shape
            raise ShapeError(
                f"a picture of shape {shape} for a sensor of {rows} x {columns} pixels; wanted "
                f"({rows}, {columns}) or a stack of such. For a lookup without pixel maps pass typical=True."
            )
        return setting, setting.dark, setting.flat, ~self.bad_pixels

    def energy(self, counts: ArrayLike, *, gain: float, typical: bool = False) -> tuple[Floats, Floats]:
        """Energy per pixel at the photocathode from raw counts, with its standard error.

        Parameters
        ----------
        counts : array
            One frame (rows, columns) or a stack (frames, rows, columns) of the calibrated sensor.
            Single numbers and one-dimensional arrays are taken as a typical pixel's.
        gain : float
            The setting.
        typical : bool
            Use a typical pixel's dark level and sensitivity in place of the pixel maps.

        Returns
        -------
        energy, stderr : Floats
            J (or relative units), same shape. NaN where the pixel is bad, saturated or brighter
            than the calibrated range; ``flags`` says which, and where a pixel is dimmer than the
            dimmest level (there the energy is by the chord to zero). ``stderr`` is the statistical
            standard error of that one reading; what all pixels share is in ``systematic`` and
            ``sample``.

        Raises
        ------
        SettingError, ShapeError
            For a setting or a frame size that was not calibrated.
        """
        raw = np.asarray(counts)
        setting, dark, flat, good = self._maps(raw.shape, gain, typical=typical)
        relative_gain = np.exp(self._gain_table.at(gain).log_gain)
        above = raw - np.asarray(dark, dtype=np.float64)
        usable = good & (raw < self.saturation_counts)
        exposure = np.where(usable, self.response.exposure(above), np.nan)
        slope = self.response.exposure_per_count(above)
        variance = (
            (setting.read_variance + setting.dark_stderr**2) * slope**2
            + setting.shot * np.maximum(exposure, 0.0)
            + (setting.flat_stderr * exposure) ** 2
        )
        scale = relative_gain * np.asarray(flat, dtype=np.float64)
        return exposure / scale, np.sqrt(variance) / scale

    def flags(self, counts: ArrayLike, *, gain: float) -> NDArray[np.uint8]:
        """Say for each pixel why its energy is missing or uncertain (see :class:`Flag`); 0 is fine."""
        raw = np.asarray(counts)
        _, dark, _, good = self._maps(raw.shape, gain, typical=False)
        above = raw - np.asarray(dark, dtype=np.float64)
        flags = np.where(good, 0, Flag.BAD) | np.where(raw >= self.saturation_counts, Flag.SATURATED, 0)
        flags |= np.where(above > self.response.limit, Flag.ABOVE_RANGE, 0)
        flags |= np.where(above < self.response.lowest, Flag.BELOW_RANGE, 0)
        return np.asarray(flags, dtype=np.uint8)

    def counts(self, energy: ArrayLike, *, gain: float, typical: bool = False) -> Floats:
        """Expected raw counts, dark level included, at an energy per pixel; the inverse of ``energy``.

        Brighter than the calibrated range it is NaN, or the saturation counts where the range
        reaches up to saturation. Parameters as in ``energy``.
        """
        values = np.asarray(energy, dtype=np.float64)
        _, dark, flat, _ = self._maps(values.shape, gain, typical=typical)
        exposure = values * np.exp(self._gain_table.at(gain).log_gain) * flat
        expected = self.response.counts(exposure) + dark
        typical_dark = float(np.median(dark))
        if self.response.limit + typical_dark >= 0.97 * self.saturation_counts:
            brighter = exposure > self.response.table[1][-1]
            expected = np.where(brighter, self.saturation_counts, expected)
        return np.asarray(np.minimum(expected, self.saturation_counts))

    def noise(self, energy: ArrayLike, *, gain: float, typical: bool = False) -> Floats:
        """Temporal standard deviation of one pixel of one frame at an energy, counts."""
        values = np.asarray(energy, dtype=np.float64)
        setting, _, flat, _ = self._maps(values.shape, gain, typical=typical)
        exposure = np.maximum(values, 0.0) * np.exp(self._gain_table.at(gain).log_gain) * flat
        slope = self.response.secant(np.nan_to_num(self.response.counts(exposure), nan=self.response.limit))
        return np.asarray(np.sqrt(setting.read_variance + setting.shot * exposure / slope**2))

    def noise_correlation(self, gain: float) -> Floats:
        """Correlation of the light's noise between two pixels against their distance (odd square)."""
        return self.setting(gain).correlation

    def draw(
        self, energy: ArrayLike, *, gain: float, rng: np.random.Generator, typical: bool = False
    ) -> NDArray[np.uint16]:
        """Make one synthetic frame: the noise model applied to a picture of energy.

        The light's noise is drawn as independent events (gamma distributed, so never negative),
        spread over the pixels as measured, sent through the response; then dark noise, rounding
        and saturation. For bootstraps with few frames.
        """
        values = np.asarray(energy, dtype=np.float64)
        setting, dark, flat, _ = self._maps(values.shape, gain, typical=typical)
        exposure = np.nan_to_num(np.maximum(values, 0.0)) * np.exp(self._gain_table.at(gain).log_gain) * flat
        exposure = np.minimum(exposure, 4.0 * self.response.table[1][-1])
        drawn = exposure
        if setting.shot > 0.0:
            kernel = spreading_kernel(setting.correlation)
            # One pixel's variance is shot * exposure after the kernel took its share sum(kernel^2).
            event = setting.shot / float((kernel**2).sum())
            drawn = event * rng.gamma(np.maximum(exposure / event, 1e-12))
            if values.ndim >= 2:
                drawn = ndimage.convolve(
                    drawn, np.broadcast_to(kernel, (1,) * (values.ndim - 2) + kernel.shape)
                )
        above = np.nan_to_num(self.response.counts(drawn), nan=self.saturation_counts)
        raw = (
            above
            + dark
            + np.sqrt(max(setting.read_variance - 1.0 / 12.0, 0.0)) * rng.standard_normal(values.shape)
        )
        return np.asarray(np.clip(np.rint(raw), 0, np.floor(self.saturation_counts)), dtype=np.uint16)

    def systematic(self, energy: float, *, gain: float) -> float:
        """Relative standard uncertainty that all pixels of this energy share.

        Response and gain, with their covariance, and the light source's common scale.
        """
        variance = self._shared_variance([(energy, gain, 1.0)])
        return float(np.sqrt(variance + self.setup.energy_scale_stderr**2))

    def ratio_systematic(self, first: tuple[float, float], second: tuple[float, float]) -> float:
        """Relative standard uncertainty of the ratio of two energies, shared errors cancelling.

        Parameters
        ----------
        first, second : (energy, gain)
            The two energies per pixel and the settings they were measured at.
        """
        return float(np.sqrt(self._shared_variance([(*first, 1.0), (*second, -1.0)])))

    def _shared_variance(self, terms: list[tuple[float, float, float]]) -> float:
        nodes = self.response.log_counts.size
        row = np.zeros(self.covariance.shape[0])
        extra = 0.0
        for energy, gain, sign in terms:
            found = self._gain_table.at(gain)
            above = self.response.counts(np.array([energy * np.exp(found.log_gain)]))
            row[:nodes] += (
                sign * self.response.node_weights(np.nan_to_num(above, nan=self.response.highest))[0]
            )
            row[nodes:] -= sign * found.weights
            extra += found.law_variance
        return max(float(row @ self.covariance @ row), 0.0) + extra

    def sample(self, n: int, *, seed: int) -> tuple[Calibration, ...]:
        """Draw calibrations from the fitted covariance, for Monte Carlo propagation (JCGM 101).

        Response, gains and the source's scale vary together as their covariance says; the pixel
        maps are shared. Any figure computed with each of them spreads by what the calibration
        contributes to its uncertainty.
        """
        rng = np.random.default_rng(seed)
        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        nodes = self.response.log_counts.size
        draws = []
        for _ in range(n):
            shift = root @ rng.standard_normal(values.size)
            scale = self.setup.energy_scale_stderr * rng.standard_normal()
            moved = rising(self.response.log_exposure + shift[:nodes] + scale)
            draws.append(
                replace(
                    self,
                    response=replace(self.response, log_exposure=moved),
                    log_gain=self.log_gain + shift[nodes:],
                    wiggle_draw=float(rng.standard_normal()),
                )
            )
        return tuple(draws)

    def lookup_table(self, gain: float) -> tuple[Floats, Floats, Floats]:
        """Give the grey-level table: raw counts of a typical pixel, energy, shared relative uncertainty."""
        low, high = self.response.lowest, min(self.response.limit, self.saturation_counts)
        dark = float(np.median(self.setting(gain).dark[~self.bad_pixels]))
        last = min(high + dark, self.saturation_counts)
        raw = np.arange(np.ceil(low + dark), np.floor(last), dtype=np.float64)
        energy, _ = self.energy(raw, gain=gain)
        row = np.zeros((raw.size, self.covariance.shape[0]))
        row[:, : self.response.log_counts.size] = self.response.node_weights(raw - dark)
        found = self._gain_table.at(gain)
        row[:, self.response.log_counts.size :] = -found.weights
        variance = np.einsum("ij,jk,ik->i", row, self.covariance, row) + found.law_variance
        shared = np.sqrt(np.maximum(variance, 0.0) + self.setup.energy_scale_stderr**2)
        return raw, energy, np.asarray(shared)

    def save(self, path: str | Path) -> None:
        """Write the calibration as one HDF5 file, whole or not at all."""
        from calibration.storage import save

        save(self, Path(path))
