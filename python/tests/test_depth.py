"""Depth and disparity, and their CoC radii."""

import warnings

import numpy as np
import pytest

import bokehcam as bc


def test_the_thin_lens():
    depth = np.array([[1.0, 2.0, 4.0, 1e9], [0.0, np.nan, np.inf, 1e-4]], np.float32)
    coc = bc.coc_from_depth(depth, 2.0, at_infinity_px=10, max_coc_px=30)
    np.testing.assert_allclose(coc, [[-10, 0, 5, 10], [10, 10, 10, -30]], rtol=1e-6)
    assert coc.dtype == np.float32 and bc.coc_from_depth(np.ones((2, 3, 4)), 1.0).shape == (2, 3, 4)
    # Defaults of the command line: a 45th of the height at infinity, limited to 0.06 of the height.
    by_height = bc.coc_from_depth(np.full((90, 10), np.inf), 1.0), bc.coc_from_depth(np.full((90, 10), 1e-3), 1.0)
    assert by_height[0][0, 0] == pytest.approx(2) and by_height[1][0, 0] == pytest.approx(-5.4)
    # 50 mm f/2 at 2 m on a 36 mm wide sensor of 1920 px: 2500 / (4 * 1950) mm = 17.09 px.
    lens = bc.coc_from_depth(
        np.full((1080, 1920), np.inf), 2.0, f_number=2, focal_length_mm=50, sensor_width_mm=36
    )
    assert lens[0, 0] == pytest.approx(17.094, abs=1e-2)
    sharp = bc.coc_from_depth(np.linspace(1.8, 2.2, 5)[None], 2.0, at_infinity_px=10, focus_range_m=0.4)
    np.testing.assert_allclose(sharp, 0, atol=1e-5)


@pytest.mark.parametrize("call, error, says", [
    (lambda: bc.coc_from_depth(np.ones(4), 1.0), ValueError, r"depth_m: shape \(4,\), wanted \(H, W\)"),
    (lambda: bc.coc_from_depth(np.ones((4, 4), bool), 1.0), TypeError, "depth_m: dtype bool"),
    (lambda: bc.coc_from_depth(np.ones((4, 4)), 0.0), ValueError, "focus_m: 0.0, wanted a number > 0"),
    (lambda: bc.coc_from_depth(np.ones((4, 4)), 1.0, at_infinity_px=-1), ValueError, "coc_at_infinity: use pixels"),
    (lambda: bc.coc_from_depth(np.ones((4, 4)), 1.0, f_number=2), ValueError, "f_number, focal_length and sensor_width"),
    (lambda: bc.coc_from_depth(np.ones((4, 4)), 1.0, f_number=2, at_infinity_px=3), ValueError, "exclude each other"),
    (lambda: bc.coc_from_disparity(np.ones(4), 1.0, -1), ValueError, "k: -1"),
    (lambda: bc.coc_from_disparity(np.ones(4), np.nan, 1), ValueError, "focus"),
])
def test_lenses_that_are_none_are_refused(call, error, says):
    with pytest.raises(error, match=says):
        call()


def test_disparity_is_the_lens_without_distances():
    rng = np.random.default_rng(1)
    disparity = rng.uniform(1, 60, (20, 30)).astype(np.float32)
    # Depth is 1 / disparity up to a unit: equals a lens with k times the focused disparity at infinity.
    coc = bc.coc_from_disparity(disparity, 20, 0.7)
    by_depth = bc.coc_from_depth(1 / disparity, 1 / 20, at_infinity_px=14, max_coc_px=100)
    np.testing.assert_allclose(coc, by_depth, atol=1e-4)
    cut = bc.coc_from_disparity([60, np.inf, np.nan], 20, 0.7, max_coc_px=10)
    np.testing.assert_allclose(cut, [-10, 10, 10], rtol=1e-6)


def pair(shift, size=(160, 96)):
    rng = np.random.default_rng(4)
    wide = np.repeat(rng.integers(0, 256, (size[1], size[0] + 64, 1), dtype=np.uint8), 3, 2)
    return wide[:, 32 : 32 + size[0]].copy(), wide[:, 32 + shift : 32 + shift + size[0]].copy()


def test_a_shift_is_found():
    left, right = pair(12)
    disparity = bc.match(left, right, max_disparity=32)
    known = disparity > 0
    assert known[:, 40:].mean() > 0.9
    np.testing.assert_allclose(np.median(disparity[known]), 12, atol=0.1)
    luma = bc.match(left[..., 0].copy(), right[..., 0].copy(), max_disparity=32)
    np.testing.assert_allclose(np.median(luma[luma > 0]), 12, atol=0.1)
    batch = bc.match(np.stack([left, left]), np.stack([right, right]), max_disparity=32)
    np.testing.assert_array_equal(batch[1], disparity)
    steady = bc.match(np.stack([left, left]), np.stack([right, right]), max_disparity=32, sequence=True)
    np.testing.assert_array_equal(steady[0], disparity)
    assert (steady[1] != disparity).any()
    np.testing.assert_array_equal(bc.match(bc.to_linear(left), bc.to_linear(right), max_disparity=32), disparity)


def test_odd_pairs_are_refused_or_warned_of():
    left, right = pair(12)
    for call, says in [
        (lambda: bc.match(left, right[:-1]), r"right: shape \(95, 160, 3\), wanted \(96, 160, 3\)"),
        (lambda: bc.match(left, right, max_disparity=160), "max_disparity: 160, wanted 1 to 144"),
        (lambda: bc.match(left[:, :16], right[:, :16]), "16 px wide, and matching needs 17"),
        (lambda: bc.match(left, right, effort="none"), "effort: use fast or full"),
    ]:
        with pytest.raises(ValueError, match=says):
            call()


def test_the_pair_of_the_recording_is_rectified_and_its_rows_moved_are_not(recordings):
    frame = bc.Recording(recordings / "stereo")[0]
    luma = np.round(frame.color @ np.array([0.299, 0.587, 0.114])).astype(np.uint8)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bc.match(luma, frame.right)
    with pytest.warns(RuntimeWarning, match="rectify it"):
        bc.match(luma, np.roll(frame.right, 4, axis=0))


def test_refined_depth_has_the_size_of_the_picture_and_no_holes(portrait):
    small = portrait.depth[::4, ::4].copy()
    small[10:30, 40:60] = 0
    refined = bc.refine(small, portrait.color)
    assert refined.shape == portrait.color.shape[:2] and refined.min() > 0.3
    near = np.abs(1 / refined - 1 / portrait.depth) < 0.15
    assert near.mean() > 0.9
    np.testing.assert_array_equal(bc.refine(small[None], portrait.color[None])[0], refined)
    assert (bc.refine(np.zeros_like(small), portrait.color) == 0).all()
    with pytest.raises(ValueError, match=r"640x50, which does not cover"):
        bc.refine(portrait.depth[:50], portrait.color)
    with pytest.raises(ValueError, match=r"depth_m: shape \(90, 160\), wanted one map for each picture of \(1, 360, 640, 3\)"):
        bc.refine(small, portrait.color[None])


def test_render_takes_depth_as_it_comes(portrait):
    holes = portrait.depth.copy()
    holes[::7, ::5] = 0
    rendered = bc.render(portrait.color, holes, focus=1.0)
    assert bc.psnr(rendered, bc.render(portrait.color, portrait.depth, focus=1.0)) > 35
    batch = bc.render(portrait.color[None], holes[None], focus=1.0)
    np.testing.assert_array_equal(batch[0], rendered)
    light = bc.render(bc.to_linear(portrait.color), holes, focus=1.0)
    assert light.dtype == np.float32
    assert np.abs(bc.to_srgb(light).astype(int) - rendered).max() <= 1
    np.testing.assert_array_equal(bc.render(portrait.color, effect="none"), portrait.color)
    soft = bc.render(portrait.color, holes, focus=1.0, aperture=bc.heart(rim=0.3))
    np.testing.assert_array_equal(soft, bc.render(portrait.color, holes, focus=1.0, aperture="heart", rim=0.3))
    np.testing.assert_array_equal(
        bc.render(portrait.color, holes, focus=(0.5, 0.4)), bc.render(portrait.color, holes, focus="0.5,0.4")
    )


@pytest.mark.parametrize("settings, says", [
    ({"effect": "dof"}, "effect dof needs depth"),
    ({"focus": -1}, "focus: "),
    ({"coc_at_infinity": 4, "f_number": 2}, "coc_at_infinity and f_number exclude each other"),
    ({"coc_at_infinity": -4}, "coc_at_infinity: use pixels from 0 to 20000"),
])
def test_settings_of_render_that_do_not_fit_are_refused(portrait, settings, says):
    with pytest.raises(ValueError, match=says):
        bc.render(portrait.color, **settings)
    with pytest.raises(ValueError, match="behind"):
        bc.render(bc.to_linear(portrait.color), portrait.depth, behind="color:#00b140")
