"""Apertures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_array, shape_of

#: Default width of the soft rim, as a fraction of the radius; half of it lies outside of the outline.
RIM = 0.2


@dataclass(frozen=True)
class LowRank:
    """A kernel as a sum of separable filters (McGraw 2015, eq. 1 and 2): ``columns.T @ rows``."""

    #: ``(rank, size)`` float64: the vertical filters, each with the root of its singular value.
    columns: npt.NDArray[np.float64]
    #: ``(rank, size)`` float64: the horizontal filters, likewise.
    rows: npt.NDArray[np.float64]
    #: ``(size,)`` float64: all singular values of the kernel, descending.
    singular_values: npt.NDArray[np.float64]
    #: Frobenius norm of the residual, relative to the kernel's.
    relative_error: float

    def kernel(self) -> npt.NDArray[np.float64]:
        """``(size, size)`` float64: the sum of the terms; it need not sum to 1."""
        return self.columns.T @ self.rows


class Aperture:
    """An aperture, drawn as a highlight far behind the focal plane shows it (x right, y down).

    Made by :func:`aperture`, :func:`disc`, :func:`ring`, :func:`polygon`, :func:`star` and :func:`heart`.
    """

    def __init__(self, shape: Any, rim: float, intensity: float):
        self.shape = shape
        self.rim = float(rim)
        self.intensity = float(intensity)
        settings = [("rim", str(self.rim)), ("intensity", str(self.intensity))]
        if isinstance(shape, str):
            self._core = _core.Aperture([("aperture", shape), *settings], None)
            return
        grey = as_array(shape, "aperture")
        if grey.ndim != 2 or 0 in grey.shape:
            raise ValueError(f"aperture: shape {shape_of(grey)}, wanted (H, W), or the name of a shape")
        if grey.dtype == np.uint8:
            grey = grey / np.float32(255)
        elif grey.dtype.kind != "f":
            raise TypeError(f"aperture: dtype {grey.dtype}, wanted uint8 or float32")
        grey = np.ascontiguousarray(grey, dtype=np.float32)
        if not ((grey >= 0) & (grey <= 1)).all():
            raise ValueError("aperture: transmittances are from 0 to 1")
        self.shape = grey
        self._core = _core.Aperture(settings, grey)

    def kernel(self, size: int = 65) -> npt.NDArray[np.float64]:
        """The kernel, antialiased: ``(size, size)`` float64, all >= 0, sum 1.

        It includes the rim's outer half, so its CoC radius is ``size / (2 + rim)`` pixels. In front of the focal plane
        the kernel is rotated by 180 degrees.
        """
        return self._core.kernel(_within("size", size, 1, 1025))

    def low_rank(self, rank: int, size: int = 65) -> LowRank:
        """The first ``rank`` terms of the singular value decomposition of :meth:`kernel`."""
        size = _within("size", size, 1, 513)
        return LowRank(*self._core.low_rank(_within("rank", rank, 1, size), size))

    def _with(self, rim: Optional[float], intensity: Optional[float]) -> "Aperture":
        if rim is None and intensity is None:
            return self
        return Aperture(self.shape, self.rim if rim is None else rim, self.intensity if intensity is None else intensity)

    def __reduce__(self) -> tuple[Any, ...]:
        return (Aperture, (self.shape, self.rim, self.intensity))

    def __repr__(self) -> str:
        shape = repr(self.shape) if isinstance(self.shape, str) else f"<{shape_of(self.shape)}>"
        return f"aperture({shape}, rim={self.rim:g}, intensity={self.intensity:g})"


def _within(name: str, value: int, low: int, high: int) -> int:
    if not isinstance(value, (int, np.integer)) or isinstance(value, bool):
        raise TypeError(f"{name}: {type(value).__name__}, wanted an int")
    if not low <= value <= high:
        raise ValueError(f"{name}: {value}, wanted {low} to {high}")
    return int(value)


def aperture(shape: Union[str, Any] = "disc", *, rim: float = RIM, intensity: float = 0.0) -> Aperture:
    """Creates an aperture.

    Args:
        shape: ``disc``, ``ring:INNER``, ``polygon:N[:ROTATION_DEG[:CURVATURE]]``, ``heart``, ``star:N`` or ``image:FILE``, as
            on the command line; or an array ``(H, W)`` of transmittances, float32 from 0 to 1 or uint8, whose larger side
            spans the disc's diameter.
        rim: Width of the soft rim as a fraction of the radius, 0 to 1, half of it outside of the outline.
        intensity: Radial intensity: -1 soap bubbles, 0 flat, 1 bright in the middle.

    Raises:
        ValueError: There is no such shape, or a number is out of its range; the message says what is accepted.
        TypeError: An array of another dtype.
    """
    return Aperture(shape, rim, intensity)


def disc(*, rim: float = RIM, intensity: float = 0.0) -> Aperture:
    """A circle. See :func:`aperture`."""
    return Aperture("disc", rim, intensity)


def ring(inner: float, *, rim: float = RIM, intensity: float = 0.0) -> Aperture:
    """A circle with a hole of ``inner`` (0 to below 1) of its radius: a mirror lens. See :func:`aperture`."""
    return Aperture(f"ring:{inner}", rim, intensity)


def polygon(
    blades: int, *, rotation_deg: float = 0.0, curvature: float = 0.0, rim: float = RIM, intensity: float = 0.0
) -> Aperture:
    """A regular polygon of 3 to 16 blades, turned clockwise; at 0 degrees one corner points to the left.

    ``curvature`` is 0 for straight blades, 1 for a circle. See :func:`aperture`.
    """
    return Aperture(f"polygon:{blades}:{rotation_deg}:{curvature}", rim, intensity)


def star(points: int, *, rim: float = RIM, intensity: float = 0.0) -> Aperture:
    """A star of 3 to 16 points, one of which points up. See :func:`aperture`."""
    return Aperture(f"star:{points}", rim, intensity)


def heart(*, rim: float = RIM, intensity: float = 0.0) -> Aperture:
    """A heart. See :func:`aperture`."""
    return Aperture("heart", rim, intensity)
