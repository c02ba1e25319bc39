"""What the bench leaves behind: a table in Markdown, everything as JSON, and a plot."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from imclab.bench.run import Bench
from imclab.files import written_whole


def write(bench: Bench, folder: Path) -> tuple[Path, ...]:
    """Write ``bench.json``, ``bench.md`` and ``bench.png`` into an existing folder and return them."""
    paths = tuple(folder / f"bench.{ending}" for ending in ("json", "md", "png"))
    with written_whole(paths[0]) as temporary:
        temporary.write_text(json.dumps(_finite(bench.document()), indent=1) + "\n", encoding="utf-8")
    with written_whole(paths[1]) as temporary:
        temporary.write_text(table(bench), encoding="utf-8")
    with written_whole(paths[2]) as temporary:
        plot(bench).savefig(temporary, format="png", dpi=110, metadata={"Software": None})
    return paths


def _finite(value: Any) -> Any:
    """Replace what JSON cannot hold, numbers that are not finite, by null."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def table(bench: Bench) -> str:
    """Return the tables as Markdown."""
    parts = [
        "# Speed against error",
        f"Machine: {bench.machine}. Longest run {bench.options.seconds:g} s, {bench.options.seeds} seeds, "
        f"one thread; reference {bench.options.reference_seconds:g} s. Seconds are of CPU. "
        "*True/stated* is the root mean square, over runs and pixels, of the true relative error over the "
        "stated one: near 1 when the stated error is true. nan: fewer than a hundred arrivals, nothing to "
        "judge by.",
        "## Estimators",
        _markdown([_estimator_row(row) for row in bench.estimators]),
        "## Forward engine",
        _markdown(bench.forward),
        "## Threads",
        _markdown(bench.threads),
        "## Cost against optical depth (auto)",
        _markdown(bench.optical_depths),
        "## Cost against pixels (auto)",
        _markdown(bench.pixels),
        "## Validation before timing",
        _markdown([{"check": check.name, "standard errors": check.z} for check in bench.checks]),
    ]
    return "\n\n".join(parts) + "\n"


def _estimator_row(row: dict[str, Any]) -> dict[str, Any]:
    total, median, rms = row["total"], row["median_pixel"], row["rms_pixel"]
    return {
        "scene": row["scene"],
        "estimator": row["estimator"],
        "total to 1 % (s)": total["cpu_seconds_to_1_percent"],
        "merit": total["figure_of_merit"],
        "true/stated": total["true_over_stated"],
        "slope": total["slope"],
        "median pixel to 1 % (s)": median["cpu_seconds_to_1_percent"],
        "RMS pixel to 1 % (s)": rms["cpu_seconds_to_1_percent"],
        "pixel true/stated": median["true_over_stated"],
        "packets/s": row["packets_per_cpu_second"],
    }


def _markdown(rows: list[dict[str, Any]]) -> str:
    if not rows:
        return "(not applicable to this scene)"
    names = list(rows[0])
    lines = [f"| {' | '.join(names)} |", f"|{'---|' * len(names)}"]
    lines += [f"| {' | '.join(_cell(row[name]) for name in names)} |" for row in rows]
    return "\n".join(lines)


def _cell(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def plot(bench: Bench) -> Figure:
    """Return true errors (points) and stated errors (lines) against seconds, total above, pixels below."""
    scenes = list(dict.fromkeys(run.scene for run in bench.runs))
    figure = Figure(figsize=(4.2 * max(len(scenes), 1), 7.0), layout="constrained")
    axes = figure.subplots(2, max(len(scenes), 1), squeeze=False, sharex=True)
    for column, scene in enumerate(scenes):
        for row, kind in enumerate(("total", "median_pixel")):
            axis = axes[row, column]
            for colour, estimator in enumerate(
                dict.fromkeys(run.estimator for run in bench.runs if run.scene == scene)
            ):
                runs = sorted(
                    (run for run in bench.runs if (run.scene, run.estimator) == (scene, estimator)),
                    key=lambda run: run.cpu_seconds,
                )
                seconds = [run.cpu_seconds for run in runs]
                axis.plot(seconds, [getattr(run, f"{kind}_true") for run in runs], ".", color=f"C{colour}")
                stated = [getattr(run, f"{kind}_stated") for run in runs]
                axis.plot(seconds, stated, "-", color=f"C{colour}", label=estimator)
            axis.set(xscale="log", yscale="log", title=f"{scene}: {kind.replace('_', ' ')}")
            axis.set_ylabel("relative error")
            axis.grid(alpha=0.3)
        axes[1, column].set_xlabel("CPU seconds")
    axes[0, 0].legend(title="lines: stated, points: true")
    return figure
