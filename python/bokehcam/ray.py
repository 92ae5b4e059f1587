"""The blur as a step of Ray Data pipelines.

::

    import ray, bokehcam.ray
    from ray.data import ActorPoolStrategy

    pictures = ray.data.read_images("photos/")
    pictures.map_batches(bokehcam.ray.Blur(coc=12.0), batch_size=8).write_images("blurred/", column="image")
    pictures.map_batches(
        bokehcam.ray.Blur, fn_constructor_kwargs={"coc": 12.0}, batch_size=8, compute=ActorPoolStrategy(size=4)
    )

The first form runs as tasks, the second as actors; either way a worker has one renderer for each size of picture and uses it
again for every batch. Nodes need this package; ``ray`` itself is not imported here.
"""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

import bokehcam

__all__ = ["Blur"]

# Maximum number of renderers that a worker keeps, one per picture size.
MAX_RENDERERS = 4


@lru_cache(maxsize=MAX_RENDERERS)
def renderer(size: tuple[int, int], settings: bytes) -> bokehcam.Renderer:
    """Returns the worker's renderer for pictures of `size` (width, height). The other settings are pickled, so that equal
    settings of different tasks share a cached renderer."""
    return bokehcam.Renderer(size, **pickle.loads(settings))


class Blur:
    """Blurs the pictures of a batch, each by its circle of confusion (CoC): a signed radius in pixels, positive behind the
    focal plane.

    Args:
        coc: the circles of confusion: the name of a column with maps, each ``(H, W)`` float32; or a function of a row (a
            dictionary of its values) that gives such a map; or a number >= 0, for all pixels alike.
        image: the column with the pictures, each ``(H, W, 3)`` uint8 (sRGB) or float32 (linear), of one size or of several.
        out: the column for the results; other columns stay as they are.
        threads: threads of a picture; one by default, as Ray starts a worker for each CPU.
        settings: other arguments of :class:`bokehcam.Renderer`: ``aperture``, ``quality``, ``max_coc_px`` and others.

    Raises:
        KeyError: a batch has no such column.
        ValueError, TypeError: as :class:`bokehcam.Renderer`; both shapes are named.
    """

    def __init__(
        self,
        coc: str | float | Callable[[dict[str, Any]], np.ndarray] = "coc",
        *,
        image: str = "image",
        out: str = "image",
        threads: int = 1,
        **settings: Any,
    ):
        self.coc, self.image, self.out = coc, image, out
        # Unknown settings fail here, not on a node.
        inspect.signature(bokehcam.Renderer).bind((1, 1), **settings)
        self.settings = pickle.dumps({"threads": threads, **settings})

    def __call__(self, batch: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """A batch as Ray Data has it in numpy format: columns of equal length."""
        for column in [self.image] + [self.coc] * isinstance(self.coc, str):
            if column not in batch:
                raise KeyError(f"there is no column {column!r}; there are {', '.join(map(repr, batch))}")
        pictures = [self.blurred({name: values[k] for name, values in batch.items()}) for k in range(len(batch[self.image]))]
        return {**batch, self.out: stacked(pictures)}

    def blurred(self, row: dict[str, Any]) -> np.ndarray:
        picture = np.asarray(row[self.image])
        if picture.ndim != 3:
            raise ValueError(f"a picture has the shape {picture.shape}, but (height, width, 3) is needed")
        height, width = picture.shape[:2]
        coc = row[self.coc] if isinstance(self.coc, str) else self.coc(row) if callable(self.coc) else self.coc
        return renderer((width, height), self.settings)(picture, coc)


def stacked(pictures: list[np.ndarray]) -> np.ndarray:
    """Pictures of one size as one array; of several sizes as an array of arrays, as Ray Data gives them."""
    if len({picture.shape for picture in pictures}) == 1:
        return np.stack(pictures)
    array = np.empty(len(pictures), dtype=object)
    array[:] = pictures
    return array
