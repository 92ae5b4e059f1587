"""Depth-aware, disc-shaped background blur, as a real lens makes it.

An aperture of any shape is split into a few separable filters (McGraw 2015); depth layers are composited front to back.

Pictures are ``(H, W, 3)`` or batches ``(N, H, W, 3)``: ``uint8`` is sRGB, ``float32`` linear light. A circle of confusion
(CoC) is a **signed radius in pixels**, positive behind the focal plane; disparity is in pixels of the rectified left
picture; depth is in metres along the optical axis, 0 or not finite = unknown; time is in nanoseconds.

>>> import bokehcam as bc
>>> coc = bc.coc_from_depth(depth_m, focus_m=1.2, at_infinity_px=24)
>>> out = bc.blur(image, coc, aperture=bc.polygon(6, curvature=0.3))
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._aperture import Aperture, LowRank, aperture, disc, heart, polygon, ring, star
    from ._blur import Renderer, blur
    from ._coc import coc_from_depth, coc_from_disparity
    from ._core import __version__
    from ._depth import match, refine
    from ._files import read_depth, read_image, write_image
    from ._recording import Frame, Recording
    from ._scene import Scene, psnr, thin_lens_scene, to_linear, to_srgb
    from ._still import render

__all__ = [
    "Aperture",
    "Frame",
    "LowRank",
    "Recording",
    "Renderer",
    "Scene",
    "__version__",
    "aperture",
    "blur",
    "coc_from_depth",
    "coc_from_disparity",
    "disc",
    "heart",
    "match",
    "polygon",
    "psnr",
    "read_depth",
    "read_image",
    "refine",
    "render",
    "ring",
    "star",
    "thin_lens_scene",
    "to_linear",
    "to_srgb",
    "write_image",
]

# The native half comes last: wrapped functions have the same names there.
_MODULES = ("_aperture", "_blur", "_coc", "_depth", "_files", "_recording", "_scene", "_still", "_core")


def __getattr__(name: str) -> Any:
    """Imports modules with the native half on first use: a farm runs without it."""
    if name in __all__:
        for module in _MODULES:
            found = vars(import_module(f".{module}", __name__))
            if name in found:
                return globals().setdefault(name, found[name])
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
