"""Properties of every blur."""

import numpy as np
import pytest

import bokehcam as bc

SIZE = (120, 72)


def ramp():
    return np.broadcast_to(np.linspace(-6, 9, SIZE[0], dtype=np.float32), SIZE[::-1]).copy()


def centre_of(light):
    y, x = np.mgrid[: light.shape[0], : light.shape[1]]
    return np.array([(x * light).sum(), (y * light).sum()]) / light.sum()


@pytest.mark.parametrize("aperture", ["disc", "heart", "polygon:6:15"])
@pytest.mark.parametrize("quality", ["draft", "balanced", "best"])
def test_a_constant_stays_constant(aperture, quality):
    settings = {"aperture": aperture, "quality": quality}
    for coc in (ramp(), 7.5):
        codes = np.full((SIZE[1], SIZE[0], 3), (10, 128, 250), np.uint8)
        assert np.abs(bc.blur(codes, coc, **settings).astype(int) - codes).max() <= 1
        light = np.full((SIZE[1], SIZE[0], 3), (1e-3, 0.5, 40), np.float32)
        np.testing.assert_allclose(bc.blur(light, coc, **settings), light, rtol=2e-5)


def test_what_is_in_focus_stays_to_the_bit():
    rng = np.random.default_rng(2)
    for image in (rng.integers(0, 256, (72, 120, 3), np.uint8), rng.normal(1, 1, (72, 120, 3)).astype(np.float32)):
        np.testing.assert_array_equal(bc.blur(image, np.zeros((72, 120), np.float32)), image)


def test_linear_light_is_not_rounded_to_codes(scene):
    """The 8-bit result is the rounded float one, and the float one keeps values that 8 bits cannot."""
    codes = scene.image_srgb
    light = bc.blur(bc.to_linear(codes), scene.coc)
    assert np.abs(bc.to_srgb(light).astype(int) - bc.blur(codes, scene.coc)).max() <= 1
    # A ramp of only a few codes must stay smooth when blurred.
    flat = np.broadcast_to(np.linspace(0.2, 0.21, 120, dtype=np.float32)[:, None], (72, 120, 3)).copy()
    blurred = bc.blur(flat, np.full((72, 120), 5, np.float32), quality="best")
    assert len(np.unique(bc.to_srgb(flat))) < 6
    np.testing.assert_allclose(blurred[:, 15:-15], flat[:, 15:-15], rtol=2e-4)


def test_light_brighter_than_white_is_spread_and_not_clipped():
    image = np.full((72, 120, 3), 0.01, np.float32)
    image[36, 60] = 500
    for coc in (8.0, np.full((72, 120), 8, np.float32)):
        blurred = bc.blur(image, coc, quality="best")
        assert 0.9 < blurred.sum() / image.sum() < 1.1
        assert blurred.max() < 10


def test_light_below_nothing_and_beyond_measure_is_cut_where_it_is_blurred():
    image = np.full((72, 120, 3), 0.5, np.float32)
    image[30:40, 50:60] = -3
    image[60, 100] = 1e30
    blurred = bc.blur(image, 4.0)
    assert np.isfinite(blurred).all() and blurred.min() >= 0 and blurred.max() <= 65504


def test_a_far_highlight_shows_the_aperture_and_a_near_one_shows_it_turned():
    """A heart is heavier above its middle, drawn as a far highlight shows it."""
    kernel = bc.heart(rim=0.1).kernel(129)
    heavier = centre_of(kernel)[1] - 64
    assert abs(heavier) > 2
    image = np.zeros((120, 120, 3), np.float32)
    image[60, 60] = 100
    for sign in (1, -1):
        blurred = bc.blur(image, np.full((120, 120), 16.0 * sign, np.float32), aperture=bc.heart(rim=0.1), quality="best")
        offset = centre_of(blurred[..., 0])[1] - 60
        assert np.sign(offset) == np.sign(heavier * sign) and abs(offset) > 0.3


def test_a_renderer_gives_the_same_again_and_on_any_number_of_threads(scene):
    image, coc = scene.image_srgb, scene.coc
    size = (image.shape[1], image.shape[0])
    expected = bc.blur(image, coc)
    for threads in (1, 3):
        renderer = bc.Renderer(size, threads=threads)
        for other in (-coc / 4, coc * 0, coc):
            result = renderer(image, other)
        np.testing.assert_array_equal(result, expected)
        np.testing.assert_array_equal(renderer(image, 5), bc.blur(image, 5))
        np.testing.assert_array_equal(renderer(image, coc), expected)


def test_it_comes_close_to_the_lens_and_closer_than_the_plain_form(scene):
    opening = bc.disc(rim=0)
    by_method = {
        method: bc.psnr(bc.blur(scene.image_srgb, scene.coc, aperture=opening, method=method), scene.truth_srgb)
        for method in ("layered", "gather")
    }
    assert by_method["layered"] > 33 and by_method["layered"] > by_method["gather"] + 1, by_method
    # What is hidden is estimated where depth tells the surfaces, and not from radii alone.
    lens = {"focus": scene.focus_m, "coc_at_infinity": scene.at_infinity_px, "rim": 0, "refine": "off"}
    by_depth = bc.psnr(bc.render(scene.image_srgb, scene.depth_m, **lens), scene.truth_srgb)
    assert by_depth > by_method["gather"] + 2, (by_depth, by_method)
    light = bc.blur(scene.image, scene.coc, aperture=opening)
    assert abs(bc.psnr(bc.to_srgb(light), scene.truth_srgb) - by_method["layered"]) < 0.3
    # The sign matches the lens: the opposite one is much further from the truth.
    assert bc.psnr(bc.blur(scene.image_srgb, -scene.coc, aperture=opening), scene.truth_srgb) < by_method["layered"] - 2


def test_pictures_that_are_small_or_odd(scene):
    for height, width in ((1, 1), (1, 40), (17, 13), (2, 600)):
        image = np.random.default_rng(3).integers(0, 256, (height, width, 3), dtype=np.uint8)
        coc = np.linspace(-1, 1, height * width, dtype=np.float32).reshape(height, width)
        assert bc.blur(image, coc).shape == image.shape
        assert bc.blur(image, 0.5).shape == image.shape
