"""A page to judge a camera calibration by: plots, figures with units, what was left out."""

from __future__ import annotations

import base64
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from imclab.files import written_whole

if TYPE_CHECKING:
    from calibration import Calibration
    from calibration import Figure as Merit

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Calibration {{ title }}</title>
<style>
body { font: 15px/1.45 sans-serif; max-width: 64em; margin: 2em auto; padding: 0 1em; color: #222 }
img { max-width: 100%; } table { border-collapse: collapse; font-size: 13px }
td, th { border-bottom: 1px solid #ddd; padding: 2px 10px; text-align: left } td.n { text-align: right }
.note { background: #fff6e0; padding: 4px 10px; margin: 4px 0 } code { font-size: 12px }
</style></head><body>
<h1>Camera calibration: {{ title }}</h1>
<p>{{ about }}</p>
{% for note in notes %}<p class="note">{{ note }}</p>{% endfor %}
{% for heading, words, picture in plots %}
<h2>{{ heading }}</h2><p>{{ words }}</p><img alt="{{ heading }}" src="data:image/png;base64,{{ picture }}">
{% endfor %}
<h2>Figures</h2>
<p>Standard uncertainties; the systematic part is shared by all readings. Names after EMVA 1288 release 4:
{{ standard }}</p>
<table><tr><th>figure</th><th>setting</th><th>value</th><th>statistical</th><th>systematic</th><th>unit</th></tr>
{% for row in rows %}<tr><td>{{ row[0] }}</td>
{% for cell in row[1:5] %}<td class="n">{{ cell }}</td>{% endfor %}
<td>{{ row[5] }}</td></tr>{% endfor %}</table>
<h2>Where it came from</h2>
<p>Folder <code>{{ folder }}</code>, {{ frame_count }} files, made {{ made }}; {{ versions }}.
The SHA-256 of every frame file is in the calibration file.</p>
</body></html>
"""

_GENERAL = "the General module, for the intensified camera as a black box."
_LINEAR = "the Linear module, for a bare sensor."


class Summary(NamedTuple):
    """What a command says of a calibration: an object for JSON, and words."""

    data: dict[str, Any]
    text: str


def summary(camera: Calibration) -> Summary:
    """Sum a calibration up in a few lines, and as plain data."""
    gains = {f"{gain:g}": camera.relative_gain(gain) for gain in camera.gains}
    lines = [
        f"{camera.setup.name or 'camera'}: {camera.shape[0]} x {camera.shape[1]} pixels, "
        f"{camera.bit_depth} bit, {int(camera.bad_pixels.sum())} bad pixels",
        f"response from {camera.response.lowest:.4g} to {camera.response.highest:.4g} counts above dark, "
        f"energy in {'J' if camera.unit == 'J' else 'relative units'}",
    ]
    lines += [
        f"gain {name}: {value:.4g} ± {error:.2g} relative to gain {camera.reference_gain:g}"
        for name, (value, error) in gains.items()
    ]
    for figure in camera.figures:
        if figure.name.startswith(("QE", "quantum")):
            lines.append(
                f"{figure.name}: {figure.value:.4g} ± {math.hypot(figure.stderr, figure.systematic):.2g}"
            )
    lines += [f"note: {note}" for note in camera.notes]
    data = {
        "gains": {name: {"value": value, "stderr": error} for name, (value, error) in gains.items()},
        "reference_gain": camera.reference_gain,
        "unit": camera.unit,
        "bad_pixels": int(camera.bad_pixels.sum()),
        "saturation_counts": camera.saturation_counts,
        "range_counts": [camera.response.lowest, camera.response.highest],
        "figures": [figure._asdict() for figure in camera.figures],
        "notes": list(camera.notes),
    }
    return Summary(data, "\n".join(lines))


def write_page(camera: Calibration, folder: Path) -> Path:
    """Write ``calibration.html`` (self-contained) and its plots as PNG files into ``folder``."""
    import jinja2

    from imclab.report import calibration_figures as figures

    folder.mkdir(parents=True, exist_ok=True)
    drawn = [
        (
            "Response",
            "Every run above the curve, below what it misses the curve by; bars are its expected size.",
            "response",
            figures.response_figure(camera),
        ),
        (
            "Photon transfer",
            "Temporal noise against signal; lines are the noise model.",
            "photon_transfer",
            figures.transfer_figure(camera),
        ),
        ("Intensifier gain", _law_words(camera), "gain", figures.gain_figure(camera)),
        ("Pixel maps", "At the reference setting.", "maps", figures.maps_figure(camera)),
    ]
    plots = []
    for heading, words, name, figure in drawn:
        picture = io.BytesIO()
        figure.savefig(picture, format="png", dpi=110, metadata={"Software": None})
        with written_whole(folder / f"{name}.png") as path:
            path.write_bytes(picture.getvalue())
        plots.append((heading, words, base64.b64encode(picture.getvalue()).decode()))
    origin = camera.provenance
    versions = ", ".join(f"{name} {version}" for name, version in origin.get("versions", {}).items())
    text = (
        jinja2.Environment(autoescape=True)
        .from_string(_PAGE)
        .render(
            title=camera.setup.name or origin.get("folder", ""),
            about=summary(camera).text.split("note:")[0],
            notes=camera.notes,
            plots=plots,
            rows=[_row(figure) for figure in camera.figures],
            standard=_GENERAL if camera.setup.intensified else _LINEAR,
            folder=origin.get("folder", ""),
            frame_count=len(origin.get("frames", {})),
            made=origin.get("made", ""),
            versions=versions,
        )
    )
    page = folder / "calibration.html"
    with written_whole(page) as path:
        path.write_text(text, encoding="utf-8")
    return page


def _law_words(camera: Calibration) -> str:
    law = camera.gain_law
    if law is None:
        return "Fewer than three settings: no law to compare with."
    use = "Settings in between may be interpolated." if law.supported else "Settings in between are refused."
    kind = "power k" if law.name == "power" else "slope per unit of the setting"
    return (
        f"Points are the truth; the {law.name} law ({kind} {law.slope:.5g} ± {law.slope_stderr:.1g}) misses "
        f"them by {law.wiggle:.2%} beyond their errors (chance of such a misfit {law.probability:.2g}). {use}"
    )


def _row(figure: Merit) -> tuple[str, ...]:
    setting = "" if math.isnan(figure.setting) else f"{figure.setting:g}"
    numbers = [f"{number:.4g}" if math.isfinite(number) else "not known" for number in figure[2:5]]
    return (figure.name, setting, *numbers, figure.unit)
