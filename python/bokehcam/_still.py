"""Pictures with depth, blurred like the command ``bokehcam render``."""

from __future__ import annotations

import warnings
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _arrays, _core
from ._aperture import Aperture
from ._arrays import Image
from ._blur import check_threads

Number = Union[int, float]


def render(
    image: Any,
    depth_m: Any = None,
    *,
    effect: Optional[str] = None,
    method: Optional[str] = None,
    focus: Union[None, Number, str, tuple[Number, Number]] = None,
    focus_range: Optional[Number] = None,
    coc_at_infinity: Union[None, Number, str] = None,
    f_number: Optional[Number] = None,
    focal_length: Optional[Number] = None,
    sensor_width: Optional[Number] = None,
    max_coc: Union[None, Number, str] = None,
    refine: Optional[str] = None,
    behind: Optional[str] = None,
    privacy: Optional[str] = None,
    tilt: Optional[str] = None,
    aperture: Union[None, str, Aperture] = None,
    intensity: Optional[Number] = None,
    rim: Optional[Number] = None,
    rank: Union[None, int, str] = None,
    highlights: Optional[Number] = None,
    quality: Optional[str] = None,
    threads: Optional[int] = None,
    out: Optional[Image] = None,
) -> Image:
    """Blurs pictures with measured depth as ``bokehcam render --depth-map`` does, to the bit.

    Unlike :func:`bokehcam.blur` it accepts raw depth with holes and noise: it finds the focus, aligns depth edges to the
    picture, fills holes, and separates the mixed pixels of outlines, which show two surfaces.

    Args:
        image: ``(H, W, 3)`` or ``(N, H, W, 3)``, ``uint8`` sRGB or ``float32`` linear light.
        depth_m: ``(h, w)`` or ``(N, h, w)``, float32 metres, 0 or not finite = unknown; of the picture's size, or smaller with
            the same aspect. Without, the effects are ``blur`` (the default then) and ``tilt-shift``.
        threads: Threads to work on; all cores unless given.
        out: Where the result goes, as for :func:`bokehcam.blur`.
        effect, method, ...: The settings of the command line, with ``_`` for ``-`` and the same values, ranges and defaults:
            ``focus=1.5`` (metres), ``"auto"`` or ``(0.5, 0.4)`` (a point of the picture); ``coc_at_infinity=20`` (pixels) or
            ``"3%"``; ``max_coc`` in pixels; ``focal_length`` and ``sensor_width`` in millimetres; ``focus_range`` in metres.

    For ``float32`` pictures, depth is refined by their 8-bit sRGB, and the blur uses the original values.

    Returns:
        The blurred picture, of the shape and dtype of ``image``.

    Raises:
        ValueError: Shapes that do not fit (both are named), a setting out of its range, settings that exclude each other.
        TypeError: Another dtype, or an array on a GPU.
    """
    settings: dict[str, Any] = dict(
        effect=effect,
        method=method,
        focus=focus,
        focus_range=focus_range,
        coc_at_infinity=coc_at_infinity,
        f_number=f_number,
        focal_length=focal_length,
        sensor_width=sensor_width,
        max_coc=max_coc,
        refine=refine,
        behind=behind,
        privacy=privacy,
        tilt=tilt,
        intensity=intensity,
        rim=rim,
        rank=rank,
        highlights=highlights,
        quality=quality,
    )
    array = _arrays.image(image)
    opening = aperture._with(rim, intensity) if isinstance(aperture, Aperture) else None
    if opening is None:
        settings["aperture"] = aperture
    if array.dtype == np.float32 and highlights:
        raise ValueError("highlights: only for uint8 pictures, which are clipped at white; use 0 for float32")
    if depth_m is not None and effect not in (None, "auto", "dof"):
        warnings.warn(f"depth_m has no effect: the effect {effect} does not use depth", stacklevel=2)
    depth = None if depth_m is None else maps("depth_m", depth_m, array)
    size = (array.shape[-2], array.shape[-3])
    core = opening._core if opening else None
    still = _core.Still(size, depth is not None, as_texts(settings), core, check_threads(threads))
    result = _arrays.result(out, array)
    places = result if array.ndim == 4 else result[None]
    for k, picture in enumerate(_arrays.pictures(array)):
        still.render(picture, depth if depth is None or array.ndim == 3 else depth[k], places[k])
    return result


def maps(name: str, value: Any, image: Image) -> npt.NDArray[np.float32]:
    """Converts depth maps of any size, one for each picture."""
    array = _arrays.as_array(value, name)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name}: dtype {array.dtype}, wanted float32")
    of = image.shape[:-1]
    if array.ndim != len(of) or array.shape[:-2] != of[:-2] or 0 in array.shape[-2:]:
        shapes = _arrays.shape_of(array), _arrays.shape_of(image)
        raise ValueError(f"{name}: shape {shapes[0]}, wanted one map for each picture of {shapes[1]}")
    return np.ascontiguousarray(array, dtype=np.float32)


def as_texts(settings: dict[str, Any]) -> list[tuple[str, str]]:
    """Formats the settings that are not None like those of the command line."""

    def text(value: Any) -> str:
        if isinstance(value, (tuple, list)):
            return ",".join(text(part) for part in value)
        return repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)

    return [(name.replace("_", "-"), text(value)) for name, value in settings.items() if value is not None]
