"""Registration on pairs of known motion, and on frames that show nothing or something else."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.ndimage import shift as translate
from scipy.stats import chi2

from imclab.errors import ImclabError
from imclab.registration import register
from tests.registration_pairs import decoy_frames, make_pair, mapped


@pytest.mark.parametrize("target", ["diver", "slit", "bars", "polygons"])
@pytest.mark.parametrize(
    ("band", "dark"), [("small", False), ("medium", True), ("large", False), ("affine", False)]
)
def test_finds_the_motion(target, band, dark):
    pair = make_pair(1, band=band, snr_db=20, target=target, dark=dark)
    found = register(pair.fixed, pair.moving, model=pair.model)
    assert found.ok, found.reason
    assert pair.target_error(found.matrix) < 0.25
    assert pair.corner_error(found.matrix) < min(5.0, 4 * found.stderr_px)


@pytest.mark.parametrize("snr_db", [0, 10, 40])
def test_finds_a_perspective_and_knows_how_well(snr_db):
    pair = make_pair(3, band="homography", snr_db=snr_db, target="bars")
    found = register(pair.fixed, pair.moving, model="homography")
    assert found.ok
    assert found.squared_distance(pair.matrix) < chi2.ppf(0.9999, 8)
    away = pair.matrix.copy()
    away[0, 2] += 6 * found.target_stderr_px + 0.5
    assert found.squared_distance(away) > chi2.ppf(0.9999, 8)  # power: another motion is outside


@pytest.mark.parametrize(
    "kind", ["empty water", "noise", "fringes", "speckle", "beam spot", "another target"]
)
def test_refuses_frames_without_the_target(kind):
    found = register(make_pair(1).fixed, decoy_frames(1)[kind])
    assert not found.ok
    assert "does not show the target" in found.reason


def test_refuses_a_part_of_the_target_blown_up_to_a_spot():
    """Bars 2.7 times as large and blurred, most of them outside the frame, explained a beam spot to 96 %."""
    pair = make_pair(52010, band="small", target="bars")
    found = register(pair.fixed, decoy_frames(52010)["beam spot"], model="homography")
    assert not found.ok
    assert "inside the frame" in found.reason
    assert register(pair.fixed, pair.moving, model="homography").ok  # power: the target itself


@pytest.mark.parametrize(
    ("seed", "other", "band", "snr_db"), [(313, 314, "homography", 5), (320, 322, "large", 40)]
)
def test_refuses_another_target_that_fits_in_part(seed, other, band, snr_db):
    """Two of three bars look like a double slit; both frames once passed."""
    targets = ("diver", "slit", "bars", "polygons")
    own, another = (
        make_pair(number, band=band, snr_db=snr_db, target=targets[number % 4]) for number in (seed, other)
    )
    found = register(own.fixed, another.moving, model="affine")
    assert not found.ok
    assert "explains" in found.reason
    assert register(own.fixed, own.moving, model=own.model).ok  # power: as noisy, but the target


def test_a_sheared_figure_is_not_imitated_by_light_and_tone():
    """From the best similarity the full appearance led to a motion off by 11 px, stated 0.9."""
    pair = make_pair(20138, band="affine", snr_db=20, target="slit")
    found = register(pair.fixed, pair.moving, model="affine")
    assert found.ok
    assert pair.corner_error(found.matrix) < 1.0
    similar = register(pair.fixed, pair.moving, model="similarity")
    assert pair.corner_error(similar.matrix) > 3.0  # power: the shear is there to be missed


def test_refuses_the_negative_of_a_frame():
    pair = make_pair(3, snr_db=40)
    assert register(pair.fixed, pair.moving).ok
    assert not register(pair.fixed, pair.moving.max() - pair.moving).ok


def test_identical_pictures_do_not_move():
    picture = make_pair(2).fixed
    found = register(picture, picture)
    assert found.ok
    np.testing.assert_allclose(found.matrix, np.eye(3), atol=1e-3)


@pytest.mark.parametrize("move", [(0.25, -0.4), (7.7, 3.3), (-4.45, 11.1)])
def test_a_shift_without_noise_is_found_to_hundredths(move):
    picture = make_pair(3, target="diver").fixed
    found = register(picture, translate(picture, move[::-1], order=5, mode="nearest"))
    assert found.ok
    np.testing.assert_allclose(mapped(found.matrix, np.array([[100.0, 100.0]]))[0] - 100, move, atol=0.01)
    assert found.target_stderr_px < 0.1


def test_a_double_slit_is_not_turned_round():
    """It looks the same after half a turn; the smallest motion is meant."""
    pair = make_pair(4, band="large", snr_db=20, target="slit")
    found = register(pair.fixed, pair.moving)
    assert pair.corner_error(found.matrix) < 1.5


def test_frames_of_other_sizes():
    for shape in ((1024, 1024), (150, 420)):
        pair = make_pair(5, band="medium", target="bars", snr_db=20, frame_shape=shape)
        found = register(pair.fixed, pair.moving)
        assert found.ok
        assert pair.target_error(found.matrix) < 0.2


def test_a_partial_view():
    pair = make_pair(6, snr_db=20, target="diver")
    half = pair.moving[:, : pair.moving.shape[1] // 2 + 8]
    found = register(pair.fixed, half)
    assert found.ok
    assert pair.target_error(found.matrix) < max(0.3, 4 * found.target_stderr_px)


@pytest.mark.parametrize("value", [0.0, 255.0, np.nan])
def test_refuses_blank_frames(value):
    found = register(make_pair(1).fixed, np.full((200, 200), value))
    assert not found.ok
    assert "blank" in found.reason
    assert np.isinf(found.stderr_px)
    with pytest.raises(ValueError, match="a registration that found one"):
        found.warp(np.zeros((200, 200)))


def test_refuses_a_simulation_without_a_target():
    found = register(np.full((100, 100), 3.0), make_pair(1).moving)
    assert not found.ok
    assert "shows no target" in found.reason


def test_dead_pixels_are_left_out():
    pair = make_pair(7, snr_db=20)
    frame = np.where(np.random.default_rng(0).random(pair.moving.shape) < 0.02, np.nan, pair.moving)
    found = register(pair.fixed, frame)
    assert found.ok
    assert pair.target_error(found.matrix) < 0.2


def test_the_simplest_motion_is_chosen():
    pair = make_pair(4, band="small", snr_db=20, target="bars")
    assert register(pair.fixed, pair.moving, model="auto").model == "similarity"
    picture = pair.fixed
    rng = np.random.default_rng(1)
    moved = translate(picture, (2.3, -1.6), order=5, mode="nearest") + rng.normal(0, 0.02, picture.shape)
    assert register(picture, moved, model="auto").model == "translation"
    bent = make_pair(0, band="homography", snr_db=40, target="bars")
    assert register(bent.fixed, bent.moving, model="auto").model == "homography"


def test_warps_go_both_ways():
    pair = make_pair(8, band="medium", snr_db=40, frame_shape=(256, 320))
    found = register(pair.fixed, pair.moving)
    seen = found.warp_fixed(pair.fixed)
    assert seen.shape == pair.moving.shape
    both = np.isfinite(seen)
    assert np.corrcoef(seen[both], pair.moving[both])[0, 1] > 0.6
    back = found.warp(seen, fill=np.nan)
    inside = np.isfinite(back)
    assert inside.sum() > 20000
    assert np.abs(back - pair.fixed)[inside].mean() < 0.02
    with pytest.raises(ImclabError, match="the registered shape"):
        found.warp(pair.fixed)


def test_what_is_handed_over_is_read_only():
    picture = make_pair(2).fixed
    found = register(picture, picture)
    for array in (found.matrix, found.covariance, found.corner_stderr_px):
        assert not array.flags.writeable


def test_refuses_what_is_no_picture():
    good = make_pair(1).fixed
    with pytest.raises(ImclabError, match="3 faults") as caught:
        register(good[:5], good.astype(complex), model="rigid")
    assert isinstance(caught.value, ValueError)
    with pytest.raises(ImclabError, match="finite simulated picture"):
        register(np.where(good > 0.5, np.nan, good), good)


def test_importing_imclab_loads_no_numba():
    code = "import sys, imclab; print({'numba', 'cv2'} & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "set()\n"
