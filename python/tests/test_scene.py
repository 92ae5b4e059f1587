"""Consistency of the ground truth."""

import numpy as np
import pytest

import bokehcam as bc


def test_a_scene_is_the_same_again_and_another_seed_is_another():
    first, again, other = (bc.thin_lens_scene(seed, (96, 54), samples=8) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.truth, again.truth)
    assert (first.truth != other.truth).any()


def test_a_closed_lens_sees_what_a_pinhole_sees():
    scene = bc.thin_lens_scene(3, (96, 54), at_infinity_px=0, samples=5)
    np.testing.assert_allclose(scene.truth, scene.image, atol=1e-6)
    assert (scene.coc == 0).all()


def test_radii_are_those_of_the_depth(scene):
    by_formula = scene.at_infinity_px * (1 - scene.focus_m / scene.depth_m)
    np.testing.assert_allclose(scene.coc, by_formula, atol=1e-4)
    assert scene.coc.min() < -1 and scene.coc.max() > 2
    # Surfaces in focus are as sharp as in the pinhole picture, except near objects in front of them.
    sharp = np.abs(scene.coc) < 0.05
    assert 0.1 < sharp.mean() < 0.9


def test_light_is_neither_lost_nor_made(scene):
    assert scene.truth.min() >= 0
    assert scene.truth.mean() == pytest.approx(scene.image.mean(), rel=0.05)


def test_more_rays_change_little():
    few, many = (bc.thin_lens_scene(5, (96, 54), samples=samples) for samples in (64, 512))
    assert bc.psnr(few.truth_srgb, many.truth_srgb) > 38
    np.testing.assert_array_equal(few.image, many.image)


def test_the_aperture_is_that_of_the_lens():
    disc, heart = (bc.thin_lens_scene(0, (96, 54), aperture=name, samples=64) for name in ("disc", "heart"))
    assert bc.psnr(disc.truth_srgb, heart.truth_srgb) < 45
    np.testing.assert_array_equal(disc.image, heart.image)


def test_codes_and_light_are_each_others_inverse():
    codes = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(bc.to_srgb(bc.to_linear(codes)), codes)
    with pytest.raises(TypeError, match="float64"):
        bc.to_linear(np.zeros(3))
    assert bc.psnr(codes, codes) == float("inf") and bc.psnr(codes, 255 - codes) < 10


@pytest.mark.parametrize("settings", [{"size": (4, 4)}, {"samples": 0}, {"at_infinity_px": -1}, {"aperture": "none"}])
def test_scenes_that_there_cannot_be_are_refused(settings):
    with pytest.raises(ValueError):
        bc.thin_lens_scene(0, **settings)
