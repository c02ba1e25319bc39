"""The reference of scene files is what the code says, and explains every key."""

from __future__ import annotations

from pathlib import Path

from imclab import scene_reference

PAGE = Path(__file__).parents[2] / "docs/scene.md"


def test_the_page_is_up_to_date() -> None:
    told = "run: python -m imclab.scene_reference > docs/scene.md"
    assert PAGE.read_text(encoding="utf-8") == scene_reference.page(), told


def test_every_key_has_words_and_no_words_lack_a_key() -> None:
    assert scene_reference.keys() == set(scene_reference.WORDS)


def test_units_limits_and_defaults_come_from_the_models() -> None:
    page = scene_reference.page()
    assert '| `attenuation` | attenuation, as `"0.42 1/m"`, ≥ 0 |' in page
    assert "| `bit_depth` | whole number, ≥ 8, ≤ 16 | `12` |" in page
    assert '| `kind` | `"single"` or `"log-normal"` or `"junge"` |' in page
