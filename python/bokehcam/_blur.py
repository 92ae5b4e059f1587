"""Blurring by the circle of confusion (CoC) of every pixel."""

from __future__ import annotations

from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _arrays, _core
from ._aperture import Aperture, aperture as make_aperture
from ._arrays import Image

#: Largest CoC radius by default, as a fraction of the picture's height.
MAX_COC_PER_HEIGHT = 0.06

Coc = Union[float, Any]
MaxCoc = Union[None, float, tuple[float, float]]


def blur(
    image: Any,
    coc: Coc,
    *,
    aperture: Union[str, Aperture] = "disc",
    rim: Optional[float] = None,
    intensity: Optional[float] = None,
    quality: str = "balanced",
    rank: Union[None, int, str] = None,
    highlights: float = 0.0,
    method: str = "layered",
    max_coc_px: MaxCoc = None,
    threads: Optional[int] = None,
    out: Optional[Image] = None,
) -> Image:
    """Blurs every pixel by its own radius, with layers kept apart: near objects take no colour from the background.

    Args:
        image: ``(H, W, 3)`` or a batch ``(N, H, W, 3)``; ``uint8`` is sRGB, ``float32`` linear light (1 = white, more is
            brighter; below 0 counts as 0, above 65504 as that).
        coc: ``(H, W)`` or ``(N, H, W)``, ``float32``: the circle of confusion of every pixel as a signed radius in pixels,
            positive behind the focal plane, negative in front of it. One map may serve a whole batch. A number >= 0 blurs all
            alike.
        aperture: The lens opening: a name as on the command line, or what :func:`bokehcam.aperture` gives.
        rim: Width of the soft rim as a fraction of the radius, 0 to 1; the aperture's (0.2) unless given.
        intensity: Radial intensity, -1 to 1; the aperture's (0) unless given.
        quality: ``draft``, ``balanced`` or ``best``: changes fidelity, never the amount of blur.
        rank: Separable terms, 1 to 16 or ``"full"``; the quality's unless given.
        highlights: Takes clipped white of ``uint8`` pictures as this many times as bright, 0 to 1000; 0 is off.
        method: ``layered``, or ``gather``: the paper's plain form, for comparison.
        max_coc_px: The largest radius, in pixels, or one in front and one behind. Filters are made for it; by default for 0.06
            of the height, or what ``coc`` reaches if that is more.
        threads: Threads to work on; all cores unless given.
        out: Where the result goes: a contiguous array of the image's shape and dtype that does not overlap it.

    Returns:
        The blurred picture, of the shape and dtype of ``image``.

    Raises:
        ValueError: Shapes that do not fit (both are named), numbers that are not finite or out of range, a radius beyond
            ``max_coc_px`` or larger than the picture's diagonal, not enough memory.
        TypeError: Another dtype, or an array on a GPU.
    """
    array = _arrays.image(image)
    size = (array.shape[-2], array.shape[-3])
    radii = _radii(coc, array)
    if max_coc_px is None and not isinstance(radii, float):
        _, low, high = radii
        max_coc_px = (max(MAX_COC_PER_HEIGHT * size[1], -low), max(MAX_COC_PER_HEIGHT * size[1], high))
    renderer = Renderer(
        size,
        aperture,
        quality,
        threads,
        rim=rim,
        intensity=intensity,
        rank=rank,
        highlights=highlights,
        method=method,
        max_coc_px=max_coc_px,
    )
    return renderer._blur(array, radii, out)


class Renderer:
    """Blurs pictures of one size; filters and buffers are created once, and nothing is allocated per picture.

    ``renderer(image, coc, out=out)`` is :func:`blur` with the same arguments, to the bit. Python threads that call one
    renderer at once take turns; it can be pickled, and used after ``os.fork``.

    Args:
        size: ``(width, height)`` of the pictures, in pixels.
        max_coc_px: The largest radius that ``coc`` may have, in pixels, or ``(in front, behind)``; by default 0.06 of the
            height. Beyond it a call raises ``ValueError``.
        aperture, quality, threads, rim, intensity, rank, highlights, method: As for :func:`blur`.

    Raises:
        ValueError: A setting out of its range, a radius larger than the picture's diagonal, not enough memory.
    """

    def __init__(
        self,
        size: tuple[int, int],
        aperture: Union[str, Aperture] = "disc",
        quality: str = "balanced",
        threads: Optional[int] = None,
        *,
        rim: Optional[float] = None,
        intensity: Optional[float] = None,
        rank: Union[None, int, str] = None,
        highlights: float = 0.0,
        method: str = "layered",
        max_coc_px: MaxCoc = None,
    ):
        width, height = (int(side) for side in size)
        if not (0 < width <= 16384 and 0 < height <= 16384):
            raise ValueError(f"size: {tuple(size)}, wanted a width and a height of 1 to 16384 pixels")
        self.size = (width, height)
        self.aperture = (aperture if isinstance(aperture, Aperture) else make_aperture(aperture))._with(rim, intensity)
        self.quality = quality
        self.threads = check_threads(threads)
        self.rank = rank
        self.highlights = highlights
        self.method = method
        if max_coc_px is None:
            max_coc_px = MAX_COC_PER_HEIGHT * height
        near, far = max_coc_px if isinstance(max_coc_px, (tuple, list)) else (max_coc_px, max_coc_px)
        #: Largest radius in front of the focal plane and behind it, in pixels.
        self.max_coc_px = (float(np.float32(near)), float(np.float32(far)))
        self._layers: Optional[_core.Blur] = None
        self._uniform: Optional[tuple[float, _core.Blur]] = None
        # Reports wrong settings now; most pictures are blurred by a map.
        self._map_executor()

    def __call__(self, image: Any, coc: Coc, out: Optional[Image] = None) -> Image:
        """The blurred picture, or batch: see :func:`blur`."""
        array = _arrays.image(image, size=self.size)
        return self._blur(array, _radii(coc, array), out)

    def _blur(self, image: Image, coc: "_Radii", out: Optional[Image]) -> Image:
        if image.dtype == np.float32 and self.highlights:
            raise ValueError("highlights: only for uint8 pictures, which are clipped at white; use 0 for float32")
        if isinstance(coc, float):
            executor, radii = self._uniform_executor(coc), None
        else:
            radii, low, high = coc
            self._check_range(low, high)
            executor = self._map_executor()
        result = _arrays.result(out, image)
        places = result if image.ndim == 4 else result[None]
        for k, picture in enumerate(_arrays.pictures(image)):
            executor.blur(picture, radii if radii is None or radii.ndim == 2 else radii[k], places[k])
        return result

    def _check_range(self, low: float, high: float) -> None:
        near, far = self.max_coc_px
        if -low > near or high > far:
            raise ValueError(
                f"coc: from {low:g} to {high:g} px, wanted {-near:g} to {far:g}; give max_coc_px=, or cut it with np.clip"
            )

    def _map_executor(self) -> _core.Blur:
        if self._layers is None:
            self._layers = self._executor(self.max_coc_px, False)
        return self._layers

    def _uniform_executor(self, radius_px: float) -> _core.Blur:
        if self._uniform is None or self._uniform[0] != radius_px:
            self._uniform = (radius_px, self._executor((0.0, radius_px), True))
        return self._uniform[1]

    def _executor(self, max_px: tuple[float, float], uniform: bool) -> _core.Blur:
        settings = [("quality", self.quality), ("method", self.method), ("highlights", str(self.highlights))]
        if self.rank is not None:
            settings.append(("rank", str(self.rank)))
        return _core.Blur(self.size, max_px, uniform, settings, self.aperture._core, self.threads)

    def __reduce__(self) -> tuple[Any, ...]:
        return (_renderer, (self.size, self.aperture, self.quality, self.threads, self._settings()))

    def _settings(self) -> dict[str, Any]:
        return {
            "rank": self.rank,
            "highlights": self.highlights,
            "method": self.method,
            "max_coc_px": self.max_coc_px,
        }

    def __repr__(self) -> str:
        near, far = self.max_coc_px
        return f"Renderer({self.size}, {self.aperture!r}, {self.quality!r}, max_coc_px=({near:g}, {far:g}))"


def _renderer(size: Any, aperture: Any, quality: Any, threads: Any, settings: dict[str, Any]) -> Renderer:
    return Renderer(size, aperture, quality, threads, **settings)


def check_threads(threads: Optional[int]) -> Optional[int]:
    if threads is not None and not 1 <= threads <= 1024:
        raise ValueError(f"threads: {threads}, wanted 1 to 1024")
    return threads


#: The radii of pictures, their minimum and maximum; or one radius for all.
_Radii = Union[float, tuple[npt.NDArray[np.float32], float, float]]


def _radii(coc: Coc, image: Image) -> _Radii:
    if isinstance(coc, (int, float, np.number)):
        radius_px = float(coc)
        if not (radius_px >= 0 and np.isfinite(radius_px)):
            raise ValueError(f"coc: {radius_px:g}, wanted a radius in pixels, >= 0, or an array of signed radii")
        return float(np.float32(radius_px))
    array = _arrays.as_array(coc, "coc")
    is_shared = image.ndim == 4 and array.ndim == 2
    radii = _arrays.plane(array, "coc", image.shape[1:3] if is_shared else image.shape[:-1])
    return (radii, *_arrays.check_finite(radii, "coc"))
