"""The plots a person judges a camera calibration by."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from calibration import Defect

if TYPE_CHECKING:
    from calibration import Calibration


def response_figure(camera: Calibration) -> Figure:
    """Response (counts above dark against exposure) with the residuals of every run below."""
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2.5, 1.0])
    table = camera.tables
    counts, exposure = camera.response.table
    nodes = camera.response.log_counts.size
    error = np.sqrt(np.maximum(np.diag(camera.covariance)[:nodes], 0.0))
    upper.loglog(exposure, counts, color="0.3", lw=1.2, label="response")
    low, high = (
        np.exp(camera.response.log_exposure - 1.96 * error),
        np.exp(camera.response.log_exposure + 1.96 * error),
    )
    upper.fill_betweenx(np.exp(camera.response.log_counts), low, high, color="0.75", label="95 %")
    for gain in camera.gains:
        here = (table["gain"] == gain) & np.isfinite(table["energy"]) & ~table["clipped"]
        at = table["energy"][here] * camera.relative_gain(gain)[0]
        upper.plot(at, table["counts"][here], "o", ms=4, label=f"gain {gain:g}")
        lower.errorbar(
            at, 100 * table["residual"][here], 100 * table["residual_scatter"][here], fmt="o", ms=3, lw=0.8
        )
    lower.axhline(0.0, color="0.3", lw=0.8)
    lower.set_ylabel("residual, %")
    lower.set_xlabel(f"exposure: energy × relative gain, {camera.unit}")
    upper.set_ylabel("counts above dark, DN")
    upper.legend(fontsize=7)
    return figure


def transfer_figure(camera: Calibration) -> Figure:
    """Photon transfer curve: temporal variance against mean counts, with the fitted noise."""
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    table = camera.tables
    for index, gain in enumerate(camera.gains):
        here = (table["gain"] == gain) & np.isfinite(table["variance"])
        axes.errorbar(
            table["counts"][here],
            table["variance"][here],
            table["variance_stderr"][here],
            fmt="o",
            ms=3,
            color=f"C{index}",
            label=f"gain {gain:g}",
        )
        counts = np.geomspace(camera.response.lowest, camera.response.highest, 200)
        energy = camera.response.exposure(counts) / camera.relative_gain(gain)[0]
        axes.plot(counts, camera.noise(energy, gain=gain) ** 2, color=f"C{index}", lw=1.0)
    axes.set(xscale="log", yscale="log", xlabel="mean counts above dark, DN", ylabel="temporal variance, DN²")
    axes.legend(fontsize=7)
    return figure


def gain_figure(camera: Calibration) -> Figure:
    """Relative gain against setting, with the better of the two laws and its misfit."""
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2.0, 1.0])
    gains = np.array(camera.gains)
    value, error = np.array([camera.relative_gain(gain) for gain in camera.gains]).T
    upper.errorbar(gains, value, 1.96 * error, fmt="o", ms=4, label="measured, 95 %")
    upper.set_yscale("log")
    law = camera.gain_law
    if law is not None:
        at = np.linspace(gains.min(), gains.max(), 200)
        upper.plot(at, np.exp(law.log_gain(at)), color="0.4", lw=1.0, label=f"{law.name} law")
        lower.errorbar(
            gains, 100 * (value / np.exp(law.log_gain(gains)) - 1), 196 * error / value, fmt="o", ms=4
        )
    lower.axhline(0.0, color="0.3", lw=0.8)
    lower.set_ylabel("off the law, %")
    lower.set_xlabel(f"gain setting{', ' + camera.setup.gain_unit if camera.setup.gain_unit else ''}")
    upper.set_ylabel(f"gain relative to {camera.reference_gain:g}")
    upper.legend(fontsize=7)
    return figure


def maps_figure(camera: Calibration) -> Figure:
    """Dark level, sensitivity and bad pixels of the reference setting."""
    figure = Figure(figsize=(10.0, 3.4), layout="constrained")
    setting = camera.setting(camera.reference_gain)
    good = ~camera.bad_pixels
    panels: list[tuple[str, Any]] = [("dark level, DN", setting.dark), ("relative sensitivity", setting.flat)]
    axes = figure.subplots(1, 3)
    for one, (title, picture) in zip(axes, panels, strict=False):
        low, high = np.quantile(picture[good], [0.005, 0.995])
        shown = one.imshow(
            picture, vmin=low, vmax=max(high, low + 1e-6), cmap="viridis", interpolation="none"
        )
        figure.colorbar(shown, ax=one, shrink=0.8)
        one.set_title(title, fontsize=9)
    for defect in Defect:
        rows, columns = np.nonzero(camera.defects & np.uint8(defect))
        axes[2].plot(columns, rows, ".", ms=4, label=f"{rows.size} {(defect.name or '').lower()}")
    axes[2].legend(fontsize=6, loc="upper right")
    axes[2].set(xlim=(0, camera.shape[1]), ylim=(camera.shape[0], 0), aspect="equal")
    axes[2].set_title(f"{int(camera.bad_pixels.sum())} bad pixels", fontsize=9)
    return figure
