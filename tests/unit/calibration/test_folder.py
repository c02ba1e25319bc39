"""Bad input is named by row or file, all of it together, before anything is saved."""

import csv
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tifffile

import calibration
from tests.camera_truth import Plan, TrueCamera, write_folder

SMALL = TrueCamera(shape=(32, 32), gains={700.0: 1.0, 750.0: 3.0}, hot=0, dead=0, blinking=0)
QUICK = Plan(levels=6, frames=2, dark_frames=4, flat_frames=3)


@pytest.fixture(scope="module")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_folder(SMALL, tmp_path_factory.mktemp("small") / "frames", QUICK, seed=2)


@pytest.fixture
def folder(pristine: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(pristine, tmp_path / "frames"))


def rows(folder: Path) -> list[list[str]]:
    with (folder / "frames.csv").open(newline="") as file:
        return list(csv.reader(file))


def write_rows(folder: Path, table: list[list[str]]) -> None:
    with (folder / "frames.csv").open("w", newline="") as file:
        csv.writer(file).writerows(table)


def change(row: int, column: int, value: str) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        table = rows(folder)
        table[row][column] = value
        write_rows(folder, table)

    return damage


def replace_frame(row: int, picture: np.ndarray) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        tifffile.imwrite(folder / rows(folder)[row][0], picture, photometric="minisblack")

    return damage


def cut_short(folder: Path) -> None:
    path = folder / rows(folder)[6][0]
    path.write_bytes(path.read_bytes()[:1500])


def swap_levels(folder: Path) -> None:
    table = rows(folder)
    table[6][2], table[9][2] = table[9][2], table[6][2]
    write_rows(folder, table)


def few_levels(folder: Path) -> None:
    write_rows(folder, rows(folder)[:8])


def saturate_setting(folder: Path) -> None:
    for row in rows(folder)[1:]:
        if row[3] == "750.0" and row[1] in ("gain", "flat"):
            tifffile.imwrite(folder / row[0], np.full((2, 32, 32), 4095, np.uint16), photometric="minisblack")


def gap_between_settings(folder: Path) -> None:
    table = rows(folder)
    gain = [row for row in table if row[1] == "gain"]
    keep = [row for row in table if row[1] != "gain" and not (row[1] == "flat" and row[3] == "750.0")]
    keep = [
        row for row in keep if row[1] != "response" or row in [r for r in table if r[1] == "response"][2:]
    ]
    write_rows(folder, [*keep, gain[0]])


NAN = np.full((32, 32), 500.0, np.float32)
NAN[3, 4] = np.nan

DAMAGE: dict[str, tuple[Callable[[Path], None], str]] = {
    "missing file": (change(6, 0, "nothing.tif"), "line 7: got file 'nothing.tif'"),
    "file twice": (change(7, 0, "response_004.tif"), "already listed in frames.csv line 6"),
    "unknown kind": (change(6, 1, "respnse"), "Did you mean 'response'"),
    "negative energy": (change(6, 2, "-1e-17"), "line 7: got energy -1e-17"),
    "energy in words": (change(6, 2, "bright"), "energy_J 'bright'"),
    "unknown column": (change(0, 2, "energy_j"), "Did you mean 'energy_J'"),
    "cell too many": (lambda f: write_rows(f, [*rows(f), ["a.tif", "dark", "", "700", "3", "x"]]), "6 cells"),
    "another size": (replace_frame(6, np.full((30, 32), 500, np.uint16)), "30 x 32 pixels"),
    "eight bit file": (replace_frame(6, np.full((32, 32), 50, np.uint8)), "uint8 pictures"),
    "too many counts": (replace_frame(6, np.full((32, 32), 5000, np.uint16)), "counts up to 5000"),
    "not a number": (replace_frame(6, NAN), "NaN or infinite"),
    "colour": (replace_frame(6, np.zeros((32, 32), np.uint64)), "numbers of type uint64"),
    "cut short": (cut_short, "response_005.tif"),
    "not a picture": (lambda f: (f / rows(f)[6][0]).write_text("hello"), "not a whole TIFF"),
    "levels swapped": (swap_levels, "More light gave fewer counts"),
    "few levels": (few_levels, "at least 4"),
    "all saturated": (saturate_setting, "gain 750: got only saturated runs"),
    "no overlap": (gap_between_settings, "no other setting has any"),
    "no setup": (lambda f: (f / "camera.toml").unlink(), "camera.toml: got no such file"),
    "unknown key": (lambda f: (f / "camera.toml").write_text("bit_dept = 12\n"), "Did you mean 'bit_depth'"),
    "bit depth": (lambda f: (f / "camera.toml").write_text("bit_depth = 24\n"), "from 8 to 16"),
    "wavelength": (
        lambda f: (f / "camera.toml").write_text("bit_depth = 12\nwavelength = 532\n"),
        '"532 nm"',
    ),
    "no table": (lambda f: (f / "frames.csv").unlink(), "--pattern"),
    "no dark": (lambda f: write_rows(f, [r for r in rows(f) if r[1] != "dark"]), "no dark frames"),
    "reference": (
        lambda f: (f / "camera.toml").write_text("bit_depth = 12\nreference_gain = 720\n"),
        "one of the settings of the frames: 700, 750",
    ),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_bad_input_is_named(folder: Path, name: str) -> None:
    damage, expected = DAMAGE[name]
    damage(folder)
    with pytest.raises(calibration.FolderError) as caught:
        calibration.calibrate(folder)
    assert expected in str(caught.value)
    assert caught.value.exit_code == 2


def test_all_faults_come_together(folder: Path) -> None:
    for name in ("missing file", "negative energy", "unknown key"):
        DAMAGE[name][0](folder)
    table = rows(folder)
    table[8][2] = "-3"
    write_rows(folder, table)
    with pytest.raises(calibration.FolderError) as caught:
        calibration.calibrate(folder)
    assert len(caught.value.faults) >= 4


def test_the_pristine_folder_is_accepted(pristine: Path) -> None:
    camera = calibration.calibrate(pristine)
    assert abs(camera.relative_gain(750)[0] / 3.0 - 1.0) < 0.02
    assert camera.notes and "blinking" in camera.notes[0]


def test_files_not_in_the_table_are_named(folder: Path) -> None:
    shutil.copy(folder / "dark_000.tif", folder / "forgotten.tif")
    assert any("forgotten.tif" in note for note in calibration.calibrate(folder).notes)


def test_folders_per_setting_with_a_pattern_give_the_same(folder: Path, tmp_path: Path) -> None:
    table = rows(folder)
    whole = calibration.calibrate(folder)
    named = tmp_path / "named"
    for number, (file, kind, energy, gain, _) in enumerate(table[1:]):
        target = named / f"gain{gain}" / f"{kind}_E{energy}_{number}.tif"
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / file, target)
    shutil.copy(folder / "camera.toml", named)
    camera = calibration.calibrate(named, pattern="gain{gain}/{kind}_E{energy_J}_*.tif")
    assert camera.relative_gain(750)[0] == pytest.approx(whole.relative_gain(750)[0])
    with pytest.raises(calibration.FolderError, match="fits none"):
        calibration.calibrate(named, pattern="{kind}-{gain}.tif")
    with pytest.raises(calibration.FolderError, match="Did you mean 'gain'"):
        calibration.calibrate(named, pattern="{kind}_{gian}.tif")


def test_left_aligned_counts_are_recognised(folder: Path) -> None:
    plain = calibration.calibrate(folder)
    for row in rows(folder)[1:]:
        picture = tifffile.imread(folder / row[0])
        tifffile.imwrite(folder / row[0], picture << 4, photometric="minisblack")
    shifted = calibration.calibrate(folder)
    assert any("left of 16" in note for note in shifted.notes)
    assert shifted.relative_gain(750) == plain.relative_gain(750)


def test_png_frames_give_the_same_as_tiff(folder: Path) -> None:
    from skimage.io import imsave

    plain = calibration.calibrate(folder)
    table = [rows(folder)[0]]
    for row in rows(folder)[1:]:
        for number, picture in enumerate(tifffile.imread(folder / row[0])):
            name = f"{Path(row[0]).stem}_{number}.png"
            imsave(folder / name, picture, check_contrast=False)
            table.append([name, *row[1:]])
        (folder / row[0]).unlink()
    write_rows(folder, table)
    assert calibration.calibrate(folder).relative_gain(750)[0] == pytest.approx(plain.relative_gain(750)[0])


def test_relative_energies_give_relative_units(tmp_path: Path) -> None:
    relative = Plan(levels=6, frames=2, dark_frames=4, flat_frames=3, relative=True)
    camera = calibration.calibrate(write_folder(SMALL, tmp_path / "frames", relative, seed=2))
    assert camera.unit == "relative"
    assert abs(camera.relative_gain(750)[0] / 3.0 - 1.0) < 0.02


def test_outlier_frames_are_reported_and_left_out(folder: Path) -> None:
    plain = calibration.calibrate(folder)
    row = rows(folder)[2]
    flat = tifffile.imread(folder / row[0])
    bright = np.concatenate([flat, flat, (flat[:1] * 1.6).astype(np.uint16)])
    tifffile.imwrite(folder / row[0], bright, photometric="minisblack")
    camera = calibration.calibrate(folder)
    assert any("outliers: 7" in note for note in camera.notes)
    assert np.allclose(camera.settings[0].flat, plain.settings[0].flat, rtol=0.05)


def test_known_gains_stand_in_for_unknown_levels(folder: Path) -> None:
    """Levels that only have names, shared by settings whose gains are known: response in relative units."""
    table = rows(folder)
    table[0] = ["file", "kind", "level", "gain", "gate_ns"]
    write_rows(folder, table)
    with (folder / "camera.toml").open("a") as file:
        file.write("[known_gain]\n700 = 1.0\n750 = 3.0\n")
    camera = calibration.calibrate(folder)
    assert camera.unit == "relative"
    assert abs(camera.relative_gain(750)[0] / 3.0 - 1.0) < 0.005
    counts = np.array([400.0, 1200.0])
    energy = camera.energy(counts + SMALL.gray_offset, gain=700)[0]
    assert abs(energy[1] / energy[0] / 3.0 - 1.0) < 0.03


def test_qe_is_printed_only_where_it_can_be_known(folder: Path) -> None:
    with (folder / "camera.toml").open("a") as file:
        file.write("excess_noise = 1.6\nexcess_noise_stderr = 0.1\n")
    values = {figure.name: figure for figure in calibration.calibrate(folder).figures}
    stated = values["QE with the stated F²"]
    assert stated.value == pytest.approx(1.6 * values["QE/F² (excess noise not separable)"].value)
    assert stated.systematic / stated.value >= 0.1 / 1.6
    (folder / "camera.toml").write_text('bit_depth = 12\nwavelength = "532 nm"\nintensified = false\n')
    bare = [figure.name for figure in calibration.calibrate(folder).figures]
    assert "quantum efficiency QE" in bare and not any("F²" in name for name in bare)


def test_stacks_in_one_piece_are_read_like_pages(folder: Path) -> None:
    plain = calibration.calibrate(folder)
    for row in rows(folder)[1:]:
        stack = tifffile.imread(folder / row[0])
        with tifffile.TiffWriter(folder / row[0], byteorder=">") as file:
            for picture in stack:
                file.write(picture, contiguous=True, photometric="minisblack")
    assert calibration.calibrate(folder).relative_gain(750)[0] == pytest.approx(plain.relative_gain(750)[0])
