"""Layered scenes through an exact thin lens: ground truth for a blur.

For a plane the inverse depth, and with it the CoC ``C``, is affine in picture coordinates. The ray through pixel ``p`` and the
lens point ``u`` (unit disc) meets the plane at ``q = p + C(q) u``, so that ``C(q) = C(p) / (1 - grad(C) . u)``: a closed form
(Potmesil and Chakravarty 1981 for the CoC; Cook, Porter and Carpenter 1984 for sampling the lens). Hidden surfaces exist,
and the lens sees them past the edges of objects.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Union

import numpy as np
import numpy.typing as npt

from ._aperture import Aperture, aperture as make_aperture
from ._coc import coc_from_depth

_F32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Scene:
    """A scene through a pinhole and through a thin lens. All arrays are float32."""

    #: ``(H, W, 3)`` linear light: the pinhole picture, whose outlines are antialiased.
    image: _F32
    #: ``(H, W)`` metres, of the surface that covers half of the pixel or more.
    depth_m: _F32
    #: ``(H, W)`` signed CoC radii in pixels, positive behind the focal plane: those of ``depth_m``.
    coc: _F32
    #: ``(H, W, 3)`` linear light: the thin lens's picture.
    truth: _F32
    #: Distance of the focal plane, in metres.
    focus_m: float
    #: CoC radius of a point at infinity, in pixels.
    at_infinity_px: float

    @property
    def image_srgb(self) -> npt.NDArray[np.uint8]:
        """``image`` as 8-bit sRGB."""
        return to_srgb(self.image)

    @property
    def truth_srgb(self) -> npt.NDArray[np.uint8]:
        """``truth`` as 8-bit sRGB."""
        return to_srgb(self.truth)


def to_srgb(light: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """8-bit sRGB of linear light of any shape (IEC 61966-2-1); 1 = white, cut to 0..1."""
    light = np.clip(np.asarray(light, np.float32), 0, 1)
    code = np.where(light <= 0.0031308, light * 12.92, 1.055 * np.power(light, 1 / 2.4) - 0.055)
    return (code * 255 + 0.5).astype(np.uint8)


def to_linear(srgb: npt.ArrayLike) -> _F32:
    """Linear light (float32, 1 = white) of 8-bit sRGB of any shape (IEC 61966-2-1)."""
    code = np.arange(256) / 255
    light = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4).astype(np.float32)
    array = np.asarray(srgb)
    if array.dtype != np.uint8:
        raise TypeError(f"srgb: dtype {array.dtype}, wanted uint8")
    found: _F32 = light[array]
    return found


def psnr(a: npt.ArrayLike, b: npt.ArrayLike) -> float:
    """Peak signal-to-noise ratio of two 8-bit pictures of one shape, in dB; infinite if they are equal."""
    first, second = np.asarray(a, np.float64), np.asarray(b, np.float64)
    if first.shape != second.shape:
        raise ValueError(f"shapes {first.shape} and {second.shape} differ")
    error = np.mean((first - second) ** 2)
    return float(10 * np.log10(255**2 / error)) if error > 0 else float("inf")


def thin_lens_scene(
    seed: int,
    size: tuple[int, int] = (320, 180),
    *,
    at_infinity_px: Union[None, float] = None,
    aperture: Union[str, Aperture] = "disc",
    samples: int = 256,
) -> Scene:
    """Creates a scene and its ground truth: a lit room, things in it, a bust in focus, and sometimes an object in front of it.

    Args:
        seed: Seed of the scene; deterministic to the bit.
        size: ``(width, height)`` in pixels.
        at_infinity_px: CoC radius of a point at infinity, in pixels; a 25th of the height unless given.
        aperture: The opening of the lens, with a hard rim.
        samples: Rays per pixel, each through another point of the lens.

    Raises:
        ValueError: A number out of its range, or an invalid aperture.
    """
    width, height = size
    if width < 16 or height < 16 or samples < 1:
        raise ValueError(f"size {tuple(size)} and samples {samples}: wanted 16x16 pixels or more, and a ray")
    largest_px = height / 25 if at_infinity_px is None else float(at_infinity_px)
    if not 0 <= largest_px <= min(size) / 2:
        raise ValueError(f"at_infinity_px: {largest_px}, wanted 0 to half of the smaller side")
    rng = np.random.default_rng(seed)
    opening = aperture if isinstance(aperture, Aperture) else make_aperture(aperture)
    focus_m = rng.uniform(0.9, 1.1)
    # The background is tilted: its inverse depth decreases with the row.
    far_m, lean = rng.uniform(3, 8), rng.uniform(0, 0.6)
    room = _Room(_texture(rng, size, rng.choice(["lights", "checks", "plain"])), far_m, lean, focus_m, largest_px)
    layers = [_Layer(_texture(rng, size, "stripes"), _blobs(rng, size, 5), rng.uniform(1.6, 2.6))]
    layers.append(_Layer(_texture(rng, size, "plain"), _bust(rng, size), focus_m))
    if rng.random() < 0.6:
        cover = _fence(size) if rng.random() < 0.5 else _blobs(rng, size, 3)
        layers.append(_Layer(_texture(rng, size, "checks"), cover, rng.uniform(0.55, 0.7)))
    for layer in layers:
        layer.focus(focus_m, largest_px)

    def seen_from(u: npt.NDArray[np.float64]) -> _F32:
        light = room.shifted(u)
        for layer in layers:
            shifted = layer.shifted(u)
            light = shifted[..., :3] + light * (1 - shifted[..., 3:])
        return light

    total = np.zeros((height, width, 3))
    points = opening._core.points(samples)
    for u in points:
        total += seen_from(u)
    depth_m = np.broadcast_to(room.depth_m[:, None], (height, width)).copy()
    for layer in layers:
        depth_m[layer.cover >= 0.5] = layer.metres
    depth_m = depth_m.astype(np.float32)
    max_coc_px = 2 * largest_px + 1
    return Scene(
        image=seen_from(np.zeros(2)).astype(np.float32),
        depth_m=depth_m,
        coc=coc_from_depth(depth_m, focus_m, at_infinity_px=largest_px, max_coc_px=max_coc_px),
        truth=(total / len(points)).astype(np.float32),
        focus_m=focus_m,
        at_infinity_px=largest_px,
    )


class _Layer:
    """A plane that faces the lens, covered in part."""

    def __init__(self, color: _F32, cover: _F32, metres: float):
        self.texture = np.dstack([color * cover[..., None], cover])
        self.cover = cover
        self.metres = metres

    def focus(self, focus_m: float, at_infinity_px: float) -> None:
        self.coc_px = at_infinity_px * (1 - focus_m / self.metres)
        self.margin = int(np.ceil(abs(self.coc_px))) + 1
        self.padded = np.pad(self.texture, ((self.margin,) * 2, (self.margin,) * 2, (0, 0)), mode="edge")

    def shifted(self, u: npt.NDArray[np.float64]) -> _F32:
        height, width = self.cover.shape
        place = self.margin + self.coc_px * u
        (x, y), (fx, fy) = np.floor(place).astype(int), (place - np.floor(place)).astype(np.float32)
        part = self.padded[y : y + height + 1, x : x + width + 1]
        rows = part[:-1] + fy * (part[1:] - part[:-1])
        light: _F32 = rows[:, :-1] + fx * (rows[:, 1:] - rows[:, :-1])
        return light


class _Room:
    """An opaque tilted plane: its CoC is affine in the row."""

    def __init__(self, color: _F32, metres: float, lean: float, focus_m: float, at_infinity_px: float):
        height = color.shape[0]
        row = np.arange(height)
        inverse_m = (1 + lean * (row / height - 0.5)) / metres
        self.color = color
        self.depth_m = 1 / inverse_m
        self.coc_px = at_infinity_px * (1 - focus_m * inverse_m)
        self.slope = self.coc_px[1] - self.coc_px[0]

    def shifted(self, u: npt.NDArray[np.float64]) -> _F32:
        height, width = self.color.shape[:2]
        coc_px = self.coc_px / (1 - self.slope * u[1])
        rows, along = _between(np.arange(height) + coc_px * u[1], height)
        color = self.color[rows] + along[:, None, None] * (self.color[np.minimum(rows + 1, height - 1)] - self.color[rows])
        columns, along = _between(np.arange(width) + (coc_px * u[0])[:, None], width)
        down = np.arange(height)[:, None]
        here = color[down, columns]
        light: _F32 = here + along[..., None] * (color[down, np.minimum(columns + 1, width - 1)] - here)
        return light


def _between(place: npt.NDArray[np.float64], count: int) -> tuple[npt.NDArray[np.intp], _F32]:
    """Returns the sample before each position and the fraction to the next; the ends are extended."""
    place = np.clip(place, 0, count - 1)
    before = place.astype(np.intp)
    return before, (place - before).astype(np.float32)


def _spread(grid: _F32, count: int, axis: int) -> _F32:
    """Upsamples a grid linearly along an axis."""
    before, along = _between(np.linspace(0, grid.shape[axis] - 1, count), grid.shape[axis])
    first = np.take(grid, before, axis)
    second = np.take(grid, np.minimum(before + 1, grid.shape[axis] - 1), axis)
    larger: _F32 = first + np.expand_dims(along, tuple(k for k in range(grid.ndim) if k != axis)) * (second - first)
    return larger


def _texture(rng: np.random.Generator, size: tuple[int, int], kind: str) -> _F32:
    width, height = size
    noise = np.zeros((height, width, 3), np.float32)
    for octave in range(6):
        cells = 3 * 2**octave
        grid = rng.random((max(2, cells * height // width + 2), cells + 2, 3), dtype=np.float32)
        noise += 0.55**octave * _spread(_spread(grid, height, 0), width, 1)
    noise = (noise - noise.min()) / (np.ptp(noise) + 1e-6)
    color = (noise * 0.6 + 0.1) * rng.uniform(0.3, 1, 3).astype(np.float32)
    y, x = np.mgrid[:height, :width]
    if kind == "checks":
        cell = int(rng.integers(height // 24 + 2, height // 8 + 3))
        color *= np.where((x // cell + y // cell) % 2, 1, 0.25)[..., None]
    if kind == "stripes":
        cell = int(rng.integers(height // 80 + 2, height // 24 + 3))
        color *= np.where((x + y) // cell % 2, 1, 0.3)[..., None]
    if kind == "lights":
        color *= 0.35
        for _ in range(60):
            middle, radius = (rng.uniform(0, width), rng.uniform(0, height)), rng.uniform(1, 1 + height / 90)
            color += _disc(x, y, *middle, radius, radius)[..., None] * (rng.uniform(0.6, 1, 3) - color)
    light: _F32 = color.astype(np.float32)
    return light


def _disc(x: npt.ArrayLike, y: npt.ArrayLike, cx: float, cy: float, rx: float, ry: float) -> _F32:
    """Returns the coverage of each pixel by an ellipse, with edges of one pixel."""
    distance = np.hypot((np.asarray(x) - cx) / rx, (np.asarray(y) - cy) / ry)
    cover: _F32 = np.clip((1 - distance) * min(rx, ry) + 0.5, 0, 1).astype(np.float32)
    return cover


def _blobs(rng: np.random.Generator, size: tuple[int, int], count: int) -> _F32:
    width, height = size
    y, x = np.mgrid[:height, :width]
    cover = np.zeros((height, width), np.float32)
    for _ in range(count):
        middle = rng.uniform(0, width), rng.uniform(0, height)
        np.maximum(cover, _disc(x, y, *middle, *rng.uniform(height / 20, height / 6, 2)), out=cover)
    return cover


def _bust(rng: np.random.Generator, size: tuple[int, int]) -> _F32:
    width, height = size
    y, x = np.mgrid[:height, :width]
    middle = width * rng.uniform(0.4, 0.6)
    head = _disc(x, y, middle, height * 0.42, height * 0.17, height * 0.23)
    bust: _F32 = np.maximum(head, _disc(x, y, middle, height * 1.05, height * 0.45, height * 0.42))
    return bust


def _fence(size: tuple[int, int]) -> _F32:
    width, height = size
    posts = (np.arange(width) - width / 16) % (width / 8) < max(2, width / 60)
    return np.broadcast_to(posts.astype(np.float32), (height, width)).copy()
