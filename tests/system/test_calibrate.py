"""``imclab calibrate`` from a folder to a file and a page."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import calibration
from imclab.cli import run
from tests.camera_truth import Plan, TrueCamera, write_folder

TRUTH = TrueCamera(shape=(48, 48), gains={700.0: 1.0, 740.0: 2.0, 780.0: 4.0})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    plan = Plan(levels=10, frames=3, dark_frames=8, flat_frames=6)
    return write_folder(TRUTH, tmp_path_factory.mktemp("calibrate") / "frames", plan, seed=7)


def test_writes_calibration_page_and_summary(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output, page = tmp_path / "camera.h5", tmp_path / "page"
    assert run(["calibrate", str(folder), "-o", str(output), "--report", str(page)]) == 0
    told = capsys.readouterr()
    assert "gain 780: 4" in told.out and "QE/F²" in told.out and str(output) in told.out
    camera = calibration.load(output)
    assert abs(camera.relative_gain(740)[0] / 2.0 - 1.0) < 0.01
    html = (page / "calibration.html").read_text(encoding="utf-8")
    for heading in ("Response", "Photon transfer", "Intensifier gain", "Pixel maps", "Figures"):
        assert f"<h2>{heading}</h2>" in html
    assert html.count("data:image/png;base64") == 4 and "http" not in html
    assert sorted(path.name for path in page.glob("*.png")) == [
        "gain.png",
        "maps.png",
        "photon_transfer.png",
        "response.png",
    ]


def test_json_is_one_object(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["calibrate", str(folder), "-o", str(tmp_path / "camera.h5"), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["gains"]["780"]["value"] == pytest.approx(4.0, rel=0.01)
    assert data["unit"] == "J" and data["reference_gain"] == 700.0 and data["bad_pixels"] == 15


def test_bad_folder_ends_with_2_and_saves_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "camera.toml").write_text("bit_dept = 12\n")
    output = tmp_path / "camera.h5"
    assert run(["calibrate", str(tmp_path / "frames"), "-o", str(output)]) == 2
    told = capsys.readouterr().err
    assert "frames.csv" in told and "Did you mean 'bit_depth'" in told and "Traceback" not in told
    assert not output.exists()


def test_calibration_alone_needs_no_heavy_library() -> None:
    code = (
        "import sys, calibration;"
        "print(*sorted({'matplotlib', 'numba', 'cv2', 'imclab', 'rig'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_stacks_and_single_frames_give_finite_energy(folder: Path) -> None:
    camera = calibration.calibrate(folder)
    frame = TRUTH.frame(5e-17, 700.0, np.random.default_rng(2))
    assert np.isfinite(camera.energy(frame, gain=700)[0][~camera.bad_pixels]).mean() > 0.99
