"""Checks and conversion of arrays for the native half."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Optional

import numpy as np
import numpy.typing as npt

from . import _core

Image = npt.NDArray[Any]
Radii = npt.NDArray[np.float32]


def as_array(value: Any, name: str) -> npt.NDArray[Any]:
    """``value`` as an array, without a copy where that is possible.

    Takes anything with ``__dlpack__`` on the CPU (torch, jax, cupy after ``.get()``), or what ``np.asarray`` takes.
    """
    if isinstance(value, np.ndarray):
        return value
    if hasattr(value, "__dlpack__"):
        if getattr(value, "requires_grad", False):
            raise TypeError(f"{name}: a tensor that requires grad; hand over {name}.detach()")
        device = value.__dlpack_device__() if hasattr(value, "__dlpack_device__") else (1, 0)
        # 1 is the CPU, 3 and 11 are its memory pinned by CUDA and ROCm.
        if int(device[0]) not in (1, 3, 11):
            raise TypeError(f"{name}: an array on a GPU; hand it over on the CPU, such as {name}.cpu()")
        return np.from_dlpack(value)
    return np.asarray(value)


def shape_of(array: npt.NDArray[Any]) -> str:
    return "(" + ", ".join(str(side) for side in array.shape) + ("," if array.ndim == 1 else "") + ")"


def image(value: Any, name: str = "image", size: Optional[tuple[int, int]] = None) -> Image:
    """A picture or a batch of them: ``(H, W, 3)`` or ``(N, H, W, 3)``, ``uint8`` or ``float32``."""
    array = as_array(value, name)
    if array.dtype not in (np.uint8, np.float32):
        raise TypeError(
            f"{name}: dtype {array.dtype}, wanted uint8 (sRGB) or float32 (linear light, 1 = white)"
        )
    wanted = "(H, W, 3) or (N, H, W, 3)"
    if size is not None:
        wanted = f"({size[1]}, {size[0]}, 3) or (N, {size[1]}, {size[0]}, 3)"
    is_image = array.ndim in (3, 4) and array.shape[-1] == 3
    if not is_image or (size is not None and array.shape[-3:-1] != (size[1], size[0])):
        hint = "; channels go last" if array.ndim in (3, 4) and array.shape[-3] == 3 and array.shape[-1] != 3 else ""
        raise ValueError(f"{name}: shape {shape_of(array)}, wanted {wanted}{hint}")
    if 0 in array.shape[-3:]:
        raise ValueError(f"{name}: shape {shape_of(array)} has no pixels")
    return array


def pictures(images: Image, name: str = "image") -> Iterator[Image]:
    """Yields the pictures of :func:`image` one by one, contiguous: a large batch is not copied as a whole."""
    for k, picture in enumerate(images if images.ndim == 4 else images[None]):
        picture = np.ascontiguousarray(picture)
        if picture.dtype == np.float32:
            check_finite(picture, f"{name}[{k}]" if images.ndim == 4 else name)
        yield picture


def check_finite(array: npt.NDArray[np.float32], name: str) -> tuple[float, float]:
    """Returns minimum and maximum of a contiguous array; refuses NaN and infinity, which a blur would spread."""
    fault, low, high = _core.survey(array)
    if fault is not None:
        place = tuple(int(i) for i in np.unravel_index(fault, array.shape))
        raise ValueError(f"{name}: {array[place]} at {place}, wanted finite numbers")
    return low, high


def plane(value: Any, name: str, of: tuple[int, ...]) -> npt.NDArray[np.float32]:
    """Converts to one number per pixel of pictures of the shape ``of``: ``float32``, contiguous."""
    array = as_array(value, name)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name}: dtype {array.dtype}, wanted float32")
    if array.shape != of:
        raise ValueError(f"{name}: shape {shape_of(array)}, wanted {shape_of(np.broadcast_to(0, of))}")
    return np.ascontiguousarray(array, dtype=np.float32)


def result(out: Any, like: Image) -> Image:
    """Returns the array for a result: ``out`` after checks, or a new one."""
    if out is None:
        return np.empty(like.shape, like.dtype)
    if not isinstance(out, np.ndarray):
        raise TypeError(f"out: {type(out).__name__}, wanted a numpy array")
    if out.dtype != like.dtype:
        raise TypeError(f"out: dtype {out.dtype}, wanted {like.dtype}, as the image has")
    if out.shape != like.shape:
        raise ValueError(f"out: shape {shape_of(out)}, wanted {shape_of(like)}")
    if not (out.flags.c_contiguous and out.flags.writeable):
        raise ValueError("out: wanted a contiguous array that can be written")
    if np.may_share_memory(out, like):
        raise ValueError("out: shares its memory with the image, which must not change meanwhile")
    return out
