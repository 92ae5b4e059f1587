"""The circle of confusion (CoC) from depth and disparity."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_array, shape_of


def coc_from_depth(
    depth_m: Any,
    focus_m: float,
    *,
    at_infinity_px: Optional[float] = None,
    f_number: Optional[float] = None,
    focal_length_mm: Optional[float] = None,
    sensor_width_mm: Optional[float] = None,
    focus_range_m: float = 0.0,
    max_coc_px: Optional[float] = None,
) -> npt.NDArray[np.float32]:
    """The thin lens: ``coc = at_infinity_px * (1 - focus_m / depth_m)``, as the command line has it, to the bit.

    Args:
        depth_m: ``(H, W)`` or ``(N, H, W)``, float32: depth in metres along the optical axis. Values that are 0 or not finite
            are unknown and count as infinitely far, so that unmeasured pixels are blurred.
        focus_m: Distance of the focal plane in metres, > 0.
        at_infinity_px: CoC radius of a point at infinity, in pixels, >= 0; a 45th of the height unless given.
        f_number, focal_length_mm, sensor_width_mm: The strength by a lens: all three, without ``at_infinity_px``.
        focus_range_m: All within half of this to either side of the focal plane is sharp, in metres.
        max_coc_px: The radius is cut here; at 0.06 of the height unless given, or at ``at_infinity_px`` if that is more.

    Returns:
        ``coc`` of the shape of ``depth_m``, float32: signed radii in pixels, positive behind the focal plane.

    Raises:
        ValueError: Another number of dimensions, a number out of its range, a lens with missing numbers.
        TypeError: A dtype that is not numeric.
    """
    depth = as_array(depth_m, "depth_m")
    if depth.dtype.kind not in "fiu":
        raise TypeError(f"depth_m: dtype {depth.dtype}, wanted float32")
    if depth.ndim not in (2, 3) or 0 in depth.shape:
        raise ValueError(f"depth_m: shape {shape_of(depth)}, wanted (H, W) or (N, H, W)")
    focus_m = _positive("focus_m", focus_m)
    lens = {"f-number": f_number, "focal-length": focal_length_mm, "sensor-width": sensor_width_mm}
    settings = [(name, str(value)) for name, value in lens.items() if value is not None]
    if at_infinity_px is not None:
        settings.append(("coc-at-infinity", str(at_infinity_px)))
    if max_coc_px is not None:
        settings.append(("max-coc", str(max_coc_px)))
    settings += [("effect", "dof"), ("focus", repr(focus_m)), ("focus-range", str(focus_range_m))]
    depth = np.ascontiguousarray(depth, dtype=np.float32)
    out = np.empty_like(depth)
    _core.coc_from_depth(depth, (depth.shape[-1], depth.shape[-2]), focus_m, settings, out)
    return out


def coc_from_disparity(
    disparity: Any, focus: float, k: float, *, max_coc_px: Optional[float] = None
) -> npt.NDArray[np.float32]:
    """``coc = k * (focus - disparity)``: no distance needs to be known.

    Args:
        disparity: float32 of any shape, in any unit: pixels of a stereo pair, or inverse depth from 0 to 1. It is large for
            near objects. Values that are not finite are unknown and count as infinitely far (0).
        focus: The disparity that is in focus, in the same unit (``disp_focus`` of BokehMe).
        k: CoC radius in pixels that one unit of disparity makes, >= 0 (``K`` of BokehMe, whose sign is opposite). For
            stereo: aperture / (2 * baseline).
        max_coc_px: The radius is cut here, in pixels; nowhere unless given.

    Returns:
        ``coc`` of the shape of ``disparity``, float32: signed radii in pixels, positive behind the focal plane.

    Raises:
        ValueError: A number out of its range.
        TypeError: A dtype that is not numeric.
    """
    array = as_array(disparity, "disparity")
    if array.dtype.kind not in "fiu":
        raise TypeError(f"disparity: dtype {array.dtype}, wanted float32")
    if not (k >= 0 and np.isfinite(k)):
        raise ValueError(f"k: {k}, wanted a number >= 0")
    if not np.isfinite(focus):
        raise ValueError(f"focus: {focus}, wanted a finite disparity")
    array = array.astype(np.float32)
    array[~np.isfinite(array)] = 0
    np.subtract(np.float32(focus), array, out=array)
    array *= np.float32(k)
    if max_coc_px is not None:
        limit = _positive("max_coc_px", max_coc_px)
        np.clip(array, -limit, limit, out=array)
    return array


def _positive(name: str, value: float) -> float:
    if not (value > 0 and np.isfinite(value)):
        raise ValueError(f"{name}: {value}, wanted a number > 0")
    return float(value)
