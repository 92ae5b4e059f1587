"""Files of single pictures, read and written like the program's."""

from __future__ import annotations

import os
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _arrays, _core

Path = Union[str, "os.PathLike[str]"]


def read_image(path: Path) -> npt.NDArray[np.uint8]:
    """A PNG or JPEG as ``(H, W, 3)`` uint8 sRGB, turned upright as its metadata says.

    Raises:
        OSError: It cannot be read; the message names it.
    """
    return _core.read_image(os.fspath(path))


def read_depth(
    path: Path, *, depth_scale: float = 5000.0, depth_invalid: Optional[int] = None
) -> npt.NDArray[np.float32]:
    """A depth map, 16-bit PNG or PFM in metres, as ``(H, W)`` float32 metres; 0 is unknown.

    Args:
        path: The file.
        depth_scale: Units of a PNG per metre.
        depth_invalid: A value of a PNG that means unknown; 0 always does.

    Raises:
        OSError: It cannot be read, or contains disparity without a scale; the message names it.
    """
    return _core.read_depth(os.fspath(path), depth_scale, depth_invalid)


def write_image(path: Path, image: Any, *, overwrite: bool = False) -> None:
    """Writes ``(H, W, 3)`` uint8 sRGB, or float32 linear light rounded to that, as .png or .jpg.

    Raises:
        OSError: The file is there already (unless ``overwrite``), or cannot be written; the message names it.
        ValueError, TypeError: The array is not a picture.
    """
    array = _arrays.image(image)
    if array.ndim != 3:
        raise ValueError(f"image: shape {_arrays.shape_of(array)}, wanted (H, W, 3)")
    _core.write_image(os.fspath(path), next(_arrays.pictures(array)), overwrite)
