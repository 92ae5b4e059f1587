"""Accepted arrays, and errors for the others."""

import numpy as np
import pytest

import bokehcam as bc

HEIGHT, WIDTH = 24, 40


@pytest.fixture
def image():
    return np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)


@pytest.fixture
def coc():
    return np.linspace(-3, 6, HEIGHT * WIDTH, dtype=np.float32).reshape(HEIGHT, WIDTH)


class OnlyDlpack:
    """An array of another library, without numpy support."""

    def __init__(self, array, device=1):
        self.array, self.device = array, device

    def __dlpack__(self, **options):
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return (self.device, 0)


def test_a_batch_is_its_pictures(image, coc):
    batch = np.stack([image, image[::-1], image[:, ::-1]])
    maps = np.stack([coc, coc[::-1], -coc])
    blurred = bc.blur(batch, maps, max_coc_px=8)
    for k in range(3):
        np.testing.assert_array_equal(blurred[k], bc.blur(batch[k], maps[k], max_coc_px=8))
    shared = bc.blur(batch, coc)
    np.testing.assert_array_equal(shared[1], bc.blur(batch[1], coc))
    assert bc.blur(batch[:0], maps[:0]).shape == (0, HEIGHT, WIDTH, 3)
    same = bc.blur(np.broadcast_to(image, (2, HEIGHT, WIDTH, 3)), coc)
    np.testing.assert_array_equal(same, np.stack([bc.blur(image, coc)] * 2))
    light = np.zeros((2, 5, 6, 3), np.float32)
    light[1, 2, 3, 0] = np.inf
    with pytest.raises(ValueError, match=r"image\[1\]: inf at \(2, 3, 0\)"):
        bc.blur(light, 1.0)


def test_others_arrays_are_taken(image, coc):
    expected = bc.blur(image, coc)
    np.testing.assert_array_equal(bc.blur(OnlyDlpack(image), OnlyDlpack(coc)), expected)
    np.testing.assert_array_equal(bc.blur(image, coc.tolist()), expected)
    np.testing.assert_array_equal(bc.blur(image, coc.astype(np.float64)), expected)
    # Neither contiguous nor in C order.
    wide = np.zeros((HEIGHT, 2 * WIDTH, 3), np.uint8)
    wide[:, ::2] = image
    np.testing.assert_array_equal(bc.blur(wide[:, ::2], np.asfortranarray(coc)), expected)
    image.flags.writeable = False
    np.testing.assert_array_equal(bc.blur(image, coc), expected)


def test_tensors_of_torch_are_taken(image, coc):
    torch = pytest.importorskip("torch")
    expected = bc.blur(image, coc)
    np.testing.assert_array_equal(bc.blur(torch.from_numpy(image), torch.from_numpy(coc)), expected)
    with pytest.raises(TypeError, match="detach"):
        bc.blur(torch.zeros(4, 4, 3, requires_grad=True), 1.0)


def test_a_result_goes_where_it_is_wanted(image, coc):
    out = np.full_like(image, 7)
    assert bc.blur(image, coc, out=out) is out
    np.testing.assert_array_equal(out, bc.blur(image, coc))


@pytest.mark.parametrize("out, error, says", [
    (lambda image: image, ValueError, "shares its memory"),
    (lambda image: np.zeros_like(image, dtype=np.float32), TypeError, "float32, wanted uint8"),
    (lambda image: np.zeros((3, 4, 3), np.uint8), ValueError, r"\(3, 4, 3\), wanted \(24, 40, 3\)"),
    (lambda image: np.zeros((HEIGHT, 2 * WIDTH, 3), np.uint8)[:, ::2], ValueError, "contiguous"),
    (lambda image: [1, 2], TypeError, "list"),
])
def test_a_place_for_the_result_that_does_not_fit_is_refused(image, coc, out, error, says):
    before = image.copy()
    with pytest.raises(error, match=says):
        bc.blur(image, coc, out=out(image))
    np.testing.assert_array_equal(image, before)


@pytest.mark.parametrize("wrong, error, says", [
    (np.zeros((5, 6, 3)), TypeError, "image: dtype float64, wanted uint8 .sRGB. or float32"),
    (np.zeros((5, 6, 3), np.int16), TypeError, "int16"),
    (np.zeros((5, 6), np.uint8), ValueError, r"image: shape \(5, 6\), wanted \(H, W, 3\) or \(N, H, W, 3\)"),
    (np.zeros((5, 6, 4), np.uint8), ValueError, r"\(5, 6, 4\)"),
    (np.zeros((3, 5, 6), np.uint8), ValueError, "channels go last"),
    (np.zeros((0, 6, 3), np.uint8), ValueError, "no pixels"),
    (np.full((5, 6, 3), np.nan, np.float32), ValueError, r"image: nan at \(0, 0, 0\)"),
    (OnlyDlpack(np.zeros((5, 6, 3), np.uint8), device=2), TypeError, "GPU"),
])
def test_pictures_that_are_none_are_refused(wrong, error, says):
    with pytest.raises(error, match=says):
        bc.blur(wrong, 2.0)


def test_radii_that_do_not_fit_are_refused(image, coc):
    for wrong, error, says in [
        (coc[:-1], ValueError, r"coc: shape \(23, 40\), wanted \(24, 40\)"),
        (coc[None], ValueError, r"\(1, 24, 40\), wanted \(24, 40\)"),
        (coc.astype(complex), TypeError, "complex"),
        (np.where(coc > 5.9, np.inf, coc), ValueError, r"coc: inf at \(23, "),
        (-1.0, ValueError, "coc: -1"),
        (float("nan"), ValueError, "coc: nan"),
        (1e5, ValueError, "blur radius of 100000 px is too large"),
    ]:
        with pytest.raises(error, match=says):
            bc.blur(image, wrong)
    renderer = bc.Renderer((WIDTH, HEIGHT), max_coc_px=(2, 10))
    with pytest.raises(ValueError, match=r"coc: from -3 to 6 px, wanted -2 to 10; give max_coc_px="):
        renderer(image, coc)
    with pytest.raises(ValueError, match=r"\(24, 40, 3\), wanted \(40, 24, 3\)"):
        bc.Renderer((HEIGHT, WIDTH))(image, coc)


@pytest.mark.parametrize("settings, says", [
    ({"quality": "superb"}, "quality: use draft, balanced or best"),
    ({"aperture": "circle"}, "aperture: use disc"),
    ({"rank": 17}, "rank: use 1 to 16, or full"),
    ({"rim": 1.5}, "rim: use a number from 0 to 1"),
    ({"intensity": -2}, "intensity: use a number from -1 to 1"),
    ({"highlights": -1}, "highlights: use a number from 0 to 1000"),
    ({"method": "magic"}, "method: use layered or gather"),
    ({"threads": 0}, "threads: 0, wanted 1 to 1024"),
    ({"max_coc_px": float("nan")}, "blur radius of NaN px"),
    ({"size": (0, 4)}, "size: "),
])
def test_settings_that_are_none_are_refused(settings, says):
    with pytest.raises(ValueError, match=says):
        bc.Renderer(**{"size": (WIDTH, HEIGHT), **settings})


@pytest.mark.parametrize("former, now", [("fast", "draft"), ("high", "balanced")])
def test_a_former_name_is_taken_with_a_warning(image, coc, former, now):
    with pytest.warns(FutureWarning, match=f"quality {former} is called {now} now"):
        blurred = bc.blur(image, coc, quality=former)
    np.testing.assert_array_equal(blurred, bc.blur(image, coc, quality=now))


def test_highlights_are_of_pictures_that_are_clipped(image, coc):
    assert (bc.blur(image, coc, highlights=20) != bc.blur(image, coc)).any()
    with pytest.raises(ValueError, match="highlights"):
        bc.blur(image.astype(np.float32), coc, highlights=20)
