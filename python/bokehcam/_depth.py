"""Depth from stereo, and refinement of depth by its picture."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _arrays, _core
from ._blur import check_threads
from ._still import as_texts, maps

#: Step and maximum of the number of disparities.
STEP, MAX_DISPARITIES = 16, 256


def match(
    left: Any,
    right: Any,
    *,
    max_disparity: int = 64,
    effort: str = "full",
    threads: Optional[int] = None,
    check: bool = True,
    sequence: bool = False,
) -> npt.NDArray[np.float32]:
    """The disparity of rectified pairs (the same point is in the same row), as ``bokehcam depth`` finds it, to the bit.

    Args:
        left: The left camera's picture: ``(H, W, 3)`` or ``(N, H, W, 3)``, ``uint8`` sRGB or ``float32`` linear light, which is
            matched as 8-bit sRGB; or luma ``(H, W)``, ``uint8``.
        right: The right camera's picture, of the same shape.
        max_disparity: Range of disparities to search, from 0, in pixels; rounded up to a multiple of 16, at most 256 and less than
            the width.
        effort: ``full``, or ``fast``: half the columns and rows.
        threads: Threads to work on; all cores unless given.
        sequence: Whether the pairs of a batch follow each other in time: each result then guides the next, and the
            results are steadier. Otherwise each is matched by itself.
        check: Warns (``RuntimeWarning``) if the first pair appears unrectified or swapped.

    Returns:
        ``(H, W)`` or ``(N, H, W)``, float32: pixels of the left picture; its column ``x`` is the right camera's column
        ``x - disparity``. 0 is unknown. With a focal length in pixels and a baseline in metres, depth in metres is
        ``focal_px * baseline_m / disparity``.

    Raises:
        ValueError: Shapes that do not fit (both are named), a number out of its range.
        TypeError: Another dtype, or an array on a GPU.
    """
    views = [_stereo_image(left, "left"), _stereo_image(right, "right")]
    shapes = [_arrays.shape_of(picture) for picture in views]
    if shapes[0] != shapes[1]:
        raise ValueError(f"right: shape {shapes[1]}, wanted {shapes[0]}, as left has")
    array = views[0]
    height, width = array.shape[-3:-1] if array.ndim > 2 else array.shape
    limit = min((width - 1) // STEP * STEP, MAX_DISPARITIES)
    if limit < STEP:
        raise ValueError(f"left: {width} px wide, and matching needs {STEP + 1} or more")
    disparities = -(-max_disparity // STEP) * STEP
    if not STEP <= disparities <= limit:
        raise ValueError(f"max_disparity: {max_disparity}, wanted 1 to {limit} for pictures {width} px wide")
    out = np.empty((len(array) if array.ndim == 4 else 1, height, width), np.float32)
    matcher: Optional[_core.Matcher] = None
    pairs = zip(_pictures(views[0], "left"), _pictures(views[1], "right"))
    for k, (left_picture, right_picture) in enumerate(pairs):
        if matcher is None or not sequence:
            matcher = _core.Matcher((width, height), disparities, effort, check_threads(threads))
        out[k], warning = matcher.disparity(left_picture, right_picture, check and k == 0)
        if warning is not None:
            warnings.warn(warning, RuntimeWarning, stacklevel=2)
    return out if array.ndim == 4 else out[0]


def refine(
    depth_m: Any, image: Any, *, focus: Union[float, str, tuple[float, float]] = "auto"
) -> npt.NDArray[np.float32]:
    """Refines measured depth for a blur: upsampled to the picture, without holes and noise, its edges aligned to colour edges.

    Args:
        depth_m: ``(h, w)`` or ``(N, h, w)``, float32 metres, 0 or not finite = unknown; of the picture's size, or smaller with
            the same aspect.
        image: ``(H, W, 3)`` or ``(N, H, W, 3)``, ``uint8`` sRGB or ``float32`` linear light, which is converted to 8-bit sRGB.
        focus: The focus: metres, ``"auto"`` or a point ``(x, y)`` as fractions of width and height. It matters because depth
            steps are weighted by their effect on the blur.

    Returns:
        ``(H, W)`` or ``(N, H, W)``, float32 metres, each map refined by itself. 0 everywhere where no depth was known.

    Raises:
        ValueError: Shapes that do not fit (both are named), or an invalid focus.
        TypeError: Another dtype, or an array on a GPU.
    """
    array = _arrays.image(image)
    depth = maps("depth_m", depth_m, array)
    settings = as_texts({"effect": "dof", "focus": focus})
    if array.ndim == 3:
        return _core.refine(depth, next(_arrays.pictures(array)), settings)
    out = np.empty(array.shape[:3], np.float32)
    for k, picture in enumerate(_arrays.pictures(array)):
        out[k] = _core.refine(depth[k], picture, settings)
    return out


def _pictures(images: npt.NDArray[Any], name: str) -> Iterator[npt.NDArray[Any]]:
    """Yields the pictures; luma has no batches."""
    return iter([images]) if images.ndim == 2 else _arrays.pictures(images, name)


def _stereo_image(value: Any, name: str) -> npt.NDArray[Any]:
    array = _arrays.as_array(value, name)
    if array.ndim == 2 and array.dtype == np.uint8 and 0 not in array.shape:
        return np.ascontiguousarray(array)
    return _arrays.image(array, name)
