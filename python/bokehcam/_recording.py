"""Recordings, frame by frame."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Optional, Union, overload

import numpy as np
import numpy.typing as npt

from . import _core


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame of a recording."""

    #: Index, from 0.
    index: int
    #: Nanoseconds after the first frame; strictly increasing.
    time_ns: int
    #: ``(H, W, 3)`` uint8 sRGB; in stereo, the left camera's.
    color: npt.NDArray[np.uint8]
    #: ``(h, w)`` float32 metres, 0 = unknown, at most as large as the picture; None if the recording has no depth.
    depth: Optional[npt.NDArray[np.float32]]
    #: ``(H, W)`` uint8 luma of the right camera; None if the recording is not stereo.
    right: Optional[npt.NDArray[np.uint8]]


class Recording(Sequence[Frame]):
    """A folder in the layout of TUM RGB-D, KITTI, EuRoC/ASL or Middlebury, recognised by its contents.

    Frames are read on access, one by one, into new arrays.

    >>> for frame in bokehcam.Recording("recordings/portrait"):
    ...     frame.color, frame.depth, frame.time_ns

    Args:
        path: The folder.
        depth_scale: Units of 16-bit depth pictures per metre, > 0; ``None`` for those of the layout.
        depth_invalid: A value of these that means unknown; 0 always does.
        keep_going: Faulty lines of its lists become frames whose reading fails; otherwise the first one fails now.

    Raises:
        OSError: The folder is no recording, or something in it cannot be read; the message names it. Reading a frame may
            raise it, too.
        ValueError: ``depth_scale`` is not > 0.
    """

    def __init__(
        self,
        path: Union[str, "os.PathLike[str]"],
        *,
        depth_scale: Optional[float] = None,
        depth_invalid: Optional[int] = None,
        keep_going: bool = False,
    ):
        self.path = os.fspath(path)
        self._options = (depth_scale, depth_invalid, keep_going)
        self._core = _core.Recording(self.path, *self._options)

    @property
    def layout(self) -> str:
        """The name of its layout, such as ``TUM RGB-D``."""
        return self._core.layout()

    @property
    def size(self) -> tuple[int, int]:
        """``(width, height)`` of its colour pictures."""
        return self._core.size()

    @property
    def period_ns(self) -> int:
        """Median distance between frames in nanoseconds."""
        return self._core.period_ns()

    @property
    def has_depth(self) -> bool:
        """Whether its frames have depth."""
        return self._core.has_depth()

    @property
    def has_right(self) -> bool:
        """Whether its frames have a right camera's picture."""
        return self._core.has_right()

    @property
    def disparities(self) -> Optional[int]:
        """Number of disparities to search, if the recording states it."""
        return self._core.disparities()

    def __len__(self) -> int:
        return self._core.len()

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: Union[int, slice]) -> Union[Frame, list[Frame]]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        place = index + len(self) if index < 0 else index
        if not 0 <= place < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        color, depth, right = self._core.read(place)
        return Frame(place, self._core.time_ns(place), color, depth, right)

    def __iter__(self) -> Iterator[Frame]:
        return (self[k] for k in range(len(self)))

    def __reduce__(self) -> tuple[Any, ...]:
        return (_open, (self.path, *self._options))

    def __repr__(self) -> str:
        width, height = self.size
        return f"<Recording {self.path!r}: {self.layout}, {len(self)} frames of {width}x{height}>"


def _open(path: str, depth_scale: Optional[float], depth_invalid: Optional[int], keep_going: bool) -> Recording:
    return Recording(path, depth_scale=depth_scale, depth_invalid=depth_invalid, keep_going=keep_going)
