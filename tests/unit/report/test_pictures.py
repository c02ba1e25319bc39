from __future__ import annotations

import dataclasses
import io

import numpy as np
from PIL import Image

from imclab.report.detail import detail
from imclab.report.pictures import DIFFERENCE, ENERGY, LARGEST, LEVELS, coloured, gradient, picture_set
from tests.unit.report import made_up


def colours_of(png: bytes) -> np.ndarray:
    with Image.open(io.BytesIO(png)) as picture:
        return np.asarray(picture.convert("RGB"))


def test_a_scale_keeps_its_ends_its_middle_and_its_missing_colour() -> None:
    row = np.array([[-9.0, -0.3, 0.0, 0.3, 9.0, np.nan]])
    seen = colours_of(coloured(row, DIFFERENCE))[0].astype(int)
    assert (seen[0] == seen[1]).all()
    assert (seen[3] == seen[4]).all()
    assert np.ptp(seen[2]) < 10  # zero has no colour
    assert seen[1][2] > seen[1][0]  # the simulation too dark: blue
    assert seen[3][0] > seen[3][2]  # too bright: red
    assert tuple(seen[5]) == DIFFERENCE.missing


def test_a_missing_pixel_looks_like_no_energy() -> None:
    ramp = np.linspace(0.0, 1.0, LEVELS)[np.newaxis]
    greys = {tuple(colour) for colour in colours_of(coloured(ramp, ENERGY))[0].tolist()}
    assert len(greys) == LEVELS
    assert ENERGY.missing not in greys


def test_large_frames_are_shown_as_means_of_blocks_within_the_region() -> None:
    pair = made_up.comparison(size=64).outcomes[0].pair
    large = {
        name: np.kron(getattr(pair, name), np.ones((12, 12)))
        for name in ("measured", "measured_stderr", "simulated", "simulated_stderr")
    }
    large["region"] = np.kron(pair.region, np.ones((12, 12))) > 0
    views = picture_set(dataclasses.replace(pair, **large), np.full((768, 768), 0.5), comment="")
    for png in views.values():
        rows, columns, _ = colours_of(png).shape
        assert LARGEST / 2 < max(rows, columns) <= LARGEST


def test_the_same_picture_gives_the_same_bytes_and_carries_its_comment() -> None:
    made = made_up.comparison(size=64)
    pair = made.outcomes[0].pair
    similarity = detail(pair, data_range=made.data_range).similarity
    first, second = (picture_set(pair, similarity, comment="Synthetic data") for _ in range(2))
    assert first == second
    with Image.open(io.BytesIO(first["z"])) as picture:
        assert picture.text["Comment"] == f"{pair.name}: z. Synthetic data"  # type: ignore[attr-defined]


def test_gradient_runs_from_one_end_of_the_scale_to_the_other() -> None:
    css = gradient("gray")
    assert css.startswith("linear-gradient(90deg,#000000,")
    assert css.endswith(")")
    assert int(css[-3:-1], 16) > 0xF0
