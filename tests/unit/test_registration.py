"""Registration on pairs of known motion, and on frames that show nothing."""

import numpy as np
import pytest

from imclab.errors import ImclabError
from imclab.registration import register
from tests.registration_pairs import make_pair, target_free_frame


@pytest.mark.parametrize("target", ["diver", "slit", "bars", "polygons"])
@pytest.mark.parametrize("band", ["small", "medium", "large", "affine"])
def test_finds_the_motion(target, band):
    pair = make_pair(1, band=band, snr_db=20, target=target)
    found = register(pair.fixed, pair.moving, model=pair.model)
    assert found.ok, found.reason
    assert pair.corner_error(found.matrix) < 1.6
    assert pair.target_error(found.matrix) < 0.25


def test_refuses_a_frame_without_the_target():
    pair = make_pair(1)
    for seed in range(4):
        found = register(pair.fixed, target_free_frame(seed))
        assert not found.ok
        assert found.reason


def test_identical_pictures_do_not_move():
    picture = make_pair(2).fixed
    found = register(picture, picture)
    assert found.ok
    np.testing.assert_allclose(found.matrix, np.eye(3), atol=1e-3)


@pytest.mark.parametrize("value", [0.0, 255.0, np.nan])
def test_refuses_blank_frames(value):
    found = register(make_pair(1).fixed, np.full((200, 200), value))
    assert not found.ok
    assert "blank" in found.reason


def test_refuses_what_is_no_picture():
    good = make_pair(1).fixed
    with pytest.raises(ImclabError, match="3 faults"):
        register(good[:5], good.astype(complex), model="rigid")
