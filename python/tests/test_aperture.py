"""Kernels and their low-rank approximations."""

import pickle

import numpy as np
import pytest

import bokehcam as bc

SHAPES = [bc.disc(), bc.ring(0.5), bc.polygon(6, curvature=0.3), bc.heart(), bc.star(5, rim=0), bc.aperture("polygon:5:10")]


@pytest.mark.parametrize("opening", SHAPES, ids=repr)
def test_kernels_and_their_terms(opening):
    kernel = opening.kernel(49)
    assert kernel.shape == (49, 49) and kernel.min() >= 0 and kernel.sum() == pytest.approx(1)
    errors = []
    for rank in (1, 3, 8, 49):
        low = opening.low_rank(rank, 49)
        assert low.columns.shape == low.rows.shape == (rank, 49) and low.singular_values.shape == (49,)
        missing = np.linalg.norm(kernel - low.kernel()) / np.linalg.norm(kernel)
        assert low.relative_error == pytest.approx(missing, abs=1e-9)
        errors.append(missing)
    assert errors[0] > errors[1] > errors[2] > errors[3] - 1e-12 and errors[3] < 1e-6
    np.testing.assert_allclose(low.singular_values, np.linalg.svd(kernel)[1], atol=1e-9)


def test_a_disc_has_the_published_errors():
    """Antialiased disc of 65 taps: 30.6, 20.3, 15.6 and 12.7 % at rank 1 to 4 (McGraw 2015)."""
    errors = [100 * bc.disc(rim=0).low_rank(rank).relative_error for rank in (1, 2, 3, 4)]
    np.testing.assert_allclose(errors, [30.6, 20.3, 15.6, 12.7], atol=0.3)


def test_an_aperture_can_be_drawn():
    grey = np.zeros((40, 40), np.float32)
    grey[:20] = 1
    drawn = bc.aperture(grey, rim=0)
    kernel = drawn.kernel(33)
    assert kernel[:16].sum() > 0.9
    np.testing.assert_allclose(bc.aperture((grey * 255).astype(np.uint8), rim=0).kernel(33), kernel)
    image = np.zeros((60, 60, 3), np.float32)
    image[30, 30] = 50
    assert bc.blur(image, 8.0, aperture=drawn)[:30].sum() > bc.blur(image, 8.0, aperture=drawn)[31:].sum() * 2
    again = pickle.loads(pickle.dumps(drawn))
    np.testing.assert_array_equal(again.kernel(33), kernel)


@pytest.mark.parametrize("make, error, says", [
    (lambda: bc.polygon(2), ValueError, "aperture: use disc, ring:INNER"),
    (lambda: bc.ring(1), ValueError, "aperture: use disc"),
    (lambda: bc.disc(rim=2), ValueError, "rim: use a number from 0 to 1"),
    (lambda: bc.aperture(np.zeros(3)), ValueError, r"aperture: shape \(3,\), wanted \(H, W\)"),
    (lambda: bc.aperture(np.full((3, 3), 2.0)), ValueError, "transmittances"),
    (lambda: bc.aperture(np.zeros((3, 3), int)), TypeError, "int64"),
    (lambda: bc.aperture("image:/no/such.png"), ValueError, "no/such.png"),
    (lambda: bc.disc().kernel(0), ValueError, "size: 0, wanted 1 to 1025"),
    (lambda: bc.disc().low_rank(9, 8), ValueError, "rank: 9, wanted 1 to 8"),
    (lambda: bc.disc().low_rank(2.5), TypeError, "rank: float"),
])
def test_apertures_that_are_none_are_refused(make, error, says):
    with pytest.raises(error, match=says):
        make()
