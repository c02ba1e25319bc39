"""The report's page in a real browser: nothing missing, nothing too wide, nothing asked of a network.

Runs once for each browser found. Where there is none, pytest says that the browser's parameter set is
empty; what can be read from the page as text is tested in `tests/unit/report/test_page.py`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from imclab.report import render
from imclab.report.page import at
from imclab.report.wording import worded
from tests.system.browser import Tab, browsers, tab
from tests.unit.report import made_up

WIDTHS = {"desktop": 1280, "phone": 390}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    render(made_up.comparison(size=200), folder, context=made_up.context())
    return folder


@pytest.fixture(scope="module", params=browsers())
def browser(request: pytest.FixtureRequest) -> Iterator[Tab]:
    with tab(request.param) as opened:
        yield opened


def test_six_conditions_of_200_by_200_stay_under_three_megabytes(folder: Path) -> None:
    assert (folder / "report.html").stat().st_size < 3e6


@pytest.mark.parametrize("width", WIDTHS.values(), ids=WIDTHS)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_page_is_whole_at_every_width(browser: Tab, folder: Path, width: int, scheme: str) -> None:
    browser.open(folder / "report.html", width=width, scheme=scheme)
    assert browser.run("document.images.length") >= 6 * 6
    assert browser.run("[...document.images].filter(i => !i.complete || i.naturalWidth === 0).length") == 0
    assert browser.run("document.documentElement.scrollWidth") <= width
    assert browser.complaints() == []
    assert browser.requests() == [(folder / "report.html").resolve().as_uri()]


@pytest.mark.parametrize("spoiled", [False, True])
def test_the_verdict_needs_no_scrolling_on_a_desktop(
    browser: Tab, folder: Path, tmp_path: Path, spoiled: bool
) -> None:
    page = tmp_path / "page.html"
    text = (folder / "report.html").read_text(encoding="utf-8")
    page.write_text(text.replace("Error ± u</th>", "Error " + 60 * "u" + "</th>") if spoiled else text)
    browser.open(page, width=1280)
    hidden = "(box => box.scrollWidth - box.clientWidth)(document.querySelector('main .scroll'))"
    assert (browser.run(hidden) > 0) == spoiled


def test_the_width_test_would_notice(browser: Tab, folder: Path, tmp_path: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    wide = tmp_path / "wide.html"
    wide.write_text(page.replace("<main>", '<main><p style="width:2000px">x</p>'), encoding="utf-8")
    browser.open(wide, width=390)
    assert browser.run("document.documentElement.scrollWidth") > 390


def test_numbers_on_the_page_are_those_of_the_json(browser: Tab, folder: Path) -> None:
    browser.open(folder / "report.html", width=1280)
    shown = browser.run(
        "[...document.querySelectorAll('data')]"
        ".map(d => [d.dataset.json, d.dataset.style, d.value, d.textContent])"
    )
    numbers: dict[str, Any] = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert len(shown) > 200
    for pointer, style, value, text in shown:
        told = at(numbers, pointer)
        assert told["value"] == (json.loads(value) if value else None), pointer
        assert text == worded(told, style), pointer


def test_every_interactive_and_graphic_element_has_a_name(browser: Tab, folder: Path) -> None:
    browser.open(folder / "report.html", width=1280)
    browser.ask("Accessibility.enable")
    nodes = browser.ask("Accessibility.getFullAXTree")["nodes"]
    browser.ask("Accessibility.disable")
    roles = {"image", "slider", "button", "link", "heading", "region", "navigation"}
    named = [node for node in nodes if node.get("role", {}).get("value") in roles and not node["ignored"]]
    assert len(named) > 60
    assert [node["role"]["value"] for node in named if not node["name"]["value"]] == []


def state(browser: Tab) -> tuple[str, str]:
    return (
        browser.run("document.querySelector('.stage').className"),
        browser.run("document.querySelector('.stage').style.getPropertyValue('--cut')"),
    )


def test_divider_moves_by_keyboard_and_by_touch(browser: Tab, folder: Path) -> None:
    browser.open(folder / "report.html", width=390)
    browser.run("document.querySelector('.stage input').focus()")
    for _ in range(5):
        browser.press("ArrowRight", 39)
    assert state(browser) == ("stage slide", "55%")
    clip = "getComputedStyle(document.querySelector('.stage .simulated')).clipPath"
    assert "55%" in browser.run(clip)
    browser.run("document.querySelector('.stage').scrollIntoView({behavior: 'instant', block: 'center'})")
    browser.settle()
    place = browser.run("document.querySelector('.stage').getBoundingClientRect().toJSON()")
    x, y = place["x"] + 0.25 * place["width"], place["y"] + 0.5 * place["height"]
    browser.drag((x + 40, y), (x, y))
    assert float(state(browser)[1].rstrip("%")) == pytest.approx(25, abs=3)


def test_blink_and_side_by_side(browser: Tab, folder: Path) -> None:
    browser.open(folder / "report.html", width=1280)
    browser.run("document.querySelector('button[value=blink]').focus()")
    browser.press("Enter", 13, text="\r")
    visible = "getComputedStyle(document.querySelector('.stage .simulated')).visibility"
    seen = browser.run(
        "new Promise(done => { const seen = new Set(); const look = setInterval(() => {"
        f"seen.add({visible});"
        "if (seen.size === 2) { clearInterval(look); done([...seen].sort()); } }, 100); })"
    )
    assert seen == ["hidden", "visible"]
    browser.run("document.querySelector('button[value=side]').click()")
    assert state(browser)[0] == "stage side"
    assert browser.run("document.querySelector('button[value=side]').getAttribute('aria-pressed')") == "true"
    left, right = (
        browser.run(f"document.querySelector('.stage .{name}').getBoundingClientRect().x")
        for name in ("measured", "simulated")
    )
    assert left < right


def test_paper_gets_both_pictures_in_light_colours(browser: Tab, folder: Path) -> None:
    browser.open(folder / "report.html", width=794, scheme="dark")  # A4 at 96 pixels per inch
    browser.ask("Emulation.setEmulatedMedia", media="print", features=[])
    assert browser.run("document.documentElement.scrollWidth") <= 794
    ground = browser.run("getComputedStyle(document.body).backgroundColor")
    controls = browser.run("getComputedStyle(document.querySelector('.controls')).display")
    clip = browser.run("getComputedStyle(document.querySelector('.stage .simulated')).clipPath")
    browser.ask("Emulation.setEmulatedMedia", media="")
    assert ground == "rgb(252, 252, 250)"
    assert controls == "none"
    assert clip == "none"


def test_text_keeps_its_contrast(browser: Tab, folder: Path) -> None:
    """WCAG AA: 4.5 for small text, in both schemes, for every colour that words are printed in."""
    for scheme in ("light", "dark"):
        browser.open(folder / "report.html", width=1280, scheme=scheme)
        ground = luminance(browser.run("getComputedStyle(document.body).backgroundColor"))
        for name in ("body", ".quiet", "a", ".good", ".fair", ".none", "td.verdict", ".made", "th"):
            colour = luminance(
                browser.run(f"getComputedStyle(document.querySelector('main {name}, {name}')).color")
            )
            high, low = max(colour, ground), min(colour, ground)
            assert (high + 0.05) / (low + 0.05) >= 4.5, (scheme, name)


def luminance(colour: str) -> float:
    """Relative luminance of ``rgb(r, g, b)`` after WCAG 2.2."""
    parts = [float(part) / 255 for part in colour[colour.index("(") + 1 : -1].split(",")[:3]]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return sum(weight * part for weight, part in zip((0.2126, 0.7152, 0.0722), linear, strict=True))
