from __future__ import annotations

import dataclasses
import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from imclab.comparison import Comparison, Outcome
from imclab.errors import OutputError
from imclab.report import Context, load, render, save
from tests.unit.report import made_up


@pytest.fixture(scope="module")
def made() -> Comparison:
    return made_up.comparison(size=64)


@pytest.fixture(scope="module")
def folder(made: Comparison, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    save(made, made_up.context(), folder)
    render(made, folder, context=made_up.context())
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file() and path.suffix != ".h5")
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def test_rendered_again_from_the_saved_file_every_byte_is_the_same(folder: Path, tmp_path: Path) -> None:
    comparison, context = load(folder)
    render(comparison, tmp_path, context=context)
    assert contents(tmp_path) == contents(folder)


def test_the_page_needs_nothing_but_itself(folder: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert not re.search(r"(?:src|href)=\"(?!data:|#)", page)
    assert "@import" not in page
    assert "url(" not in page
    assert "default-src 'none'" in page


def test_every_number_of_the_page_is_that_of_the_json(folder: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    numbers = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    shown = re.findall(r'<data value="([^"]*)" data-json="([^"]*)"', page)
    assert len(shown) > 150
    for value, pointer in shown:
        place = numbers
        for part in pointer.split("/")[1:]:
            place = place[int(part)] if isinstance(place, list) else place[part]
        assert value == ("" if place["value"] is None else json.dumps(place["value"])), pointer


def test_synthetic_data_are_labelled_wherever_they_show(folder: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "<title>Synthetic data:" in page
    assert page.count("<figcaption>") == len(
        re.findall(r"<figcaption>.*?Synthetic data\..*?</figcaption>", page, re.S)
    )
    assert json.loads((folder / "report.json").read_text(encoding="utf-8"))["synthetic"] is True
    for file in (folder / "figures").iterdir():
        with Image.open(file) as picture:
            assert "Synthetic data" in picture.text["Comment"], file.name  # type: ignore[attr-defined]


def test_measured_data_are_not_called_synthetic(made: Comparison, tmp_path: Path) -> None:
    real = dataclasses.replace(
        made, synthetic=False, outcomes=made.outcomes[:2], covariance=made.covariance[:2, :2]
    )
    render(real, tmp_path, context=Context())
    for name in ("report.html", "report.json"):
        text = (tmp_path / name).read_text(encoding="utf-8").replace('"synthetic": false', "")
        assert "ynthetic" not in text.split("<style>")[0] + text.split("</style>")[-1]


def test_every_figure_has_a_text_and_headings_are_in_order(folder: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert all('alt="' in image and 'alt=""' not in image for image in re.findall(r"<img [^>]*>", page))
    levels = [int(level) for level in re.findall(r"<h([1-6])", page)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in itertools.pairwise(levels))


def test_nothing_of_the_machine_is_on_the_page(folder: Path) -> None:
    text = (folder / "report.html").read_text(encoding="utf-8") + (folder / "report.json").read_text(
        encoding="utf-8"
    )
    assert str(folder) not in text
    assert not re.search(r"[\"> ]/(?:home|root|tmp|Users)/", text)


def test_names_with_markup_and_odd_letters_are_shown_as_they_are(made: Comparison, tmp_path: Path) -> None:
    pair = dataclasses.replace(made.outcomes[0].pair, name="a <b> & ü", gain=np.float64(700))
    odd = dataclasses.replace(made.outcomes[0], pair=pair, reference="a <b> & ü")
    only = dataclasses.replace(
        made, title="<script>alert(1)</script>", outcomes=(odd,), covariance=np.zeros((1, 1))
    )
    paths = render(only, tmp_path, context=Context())
    page = paths.page.read_text(encoding="utf-8")
    assert "<script>alert" not in page
    assert "a &lt;b&gt; &amp; ü" in page
    assert all(path.is_file() for path in paths.figures)


@pytest.mark.parametrize("change", ["dark", "no motion", "no times", "constant"])
def test_hard_pairs_still_give_a_page(made: Comparison, tmp_path: Path, change: str) -> None:
    outcome = made.outcomes[1]
    pair = outcome.pair
    if change == "dark":
        pair = dataclasses.replace(
            pair, simulated=np.zeros_like(pair.simulated), measured=np.zeros_like(pair.measured)
        )
    elif change == "no motion":
        lost = dataclasses.replace(
            pair.registration, ok=False, reason="no target", matrix=np.full((3, 3), np.nan)
        )
        pair = dataclasses.replace(pair, registration=lost)
    elif change == "no times":
        result = dataclasses.replace(pair.result, time_edges=None, time_energy=None, time_stderr=None)
        pair = dataclasses.replace(pair, result=result)
    else:
        flat = np.full_like(pair.simulated, 1e-17)
        pair = dataclasses.replace(pair, simulated=flat, measured=flat, simulated_stderr=0 * flat)
    outcomes = (made.outcomes[0], dataclasses.replace(outcome, pair=pair))
    paths = render(
        dataclasses.replace(made, outcomes=outcomes, covariance=made.covariance[:2, :2]),
        tmp_path,
        context=made_up.context(),
    )
    json.loads(paths.numbers.read_text(encoding="utf-8"))


def test_a_folder_that_cannot_be_written_to_is_told(made: Comparison, tmp_path: Path) -> None:
    (tmp_path / "figures").write_text("in the way", encoding="utf-8")
    with pytest.raises(OutputError, match="cannot be written"):
        render(made, tmp_path, context=Context())
    assert not (tmp_path / "report.html").exists()


def test_inputs_that_were_not_stated_are_not_called_zero(made: Comparison, tmp_path: Path) -> None:
    def without(outcome: Outcome) -> Outcome:
        kept = {name: u for name, u in outcome.error.budget.items() if name != "medium.attenuation"}
        return dataclasses.replace(outcome, error=dataclasses.replace(outcome.error, budget=kept))

    for comparison, says in (
        (made, False),
        (dataclasses.replace(made, outcomes=tuple(map(without, made.outcomes))), True),
    ):
        render(comparison, tmp_path, context=made_up.context())
        page = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert ("u_input is missing, not zero" in page) == says
        assert ("<td>not stated</td>" in page) == says
