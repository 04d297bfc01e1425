"""Depth maps that are gone through more than once, though they are made once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from room2dgs.captures.cache import Cache
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.views import FusedView


class KeptViews:
    """The views in the CPU's memory, and what has no room there on the disk: rendering takes longer than reading."""

    def __init__(self, views: Iterable[FusedView]) -> None:
        self._views = views
        self._cameras: list[Camera] = []
        self._whole = False
        self._cache = Cache()

    def __iter__(self) -> Iterator[FusedView]:
        if self._whole:
            for number, camera in enumerate(self._cameras):
                kept = self._cache.get(number)
                assert kept is not None, "what is kept is not dropped before `clear`"
                depth, color, *others = kept
                yield FusedView(camera, depth, color, *(part if part.size else None for part in others))
            return
        self._cameras = []
        for number, view in enumerate(self._views):
            there = view.on_cpu()
            self._cameras.append(there.camera)
            parts = (there.depth, _as_bytes(np.asarray(there.color)), there.weight, there.normal, there.expected)
            self._cache.put(number, tuple(np.zeros(0) if part is None else np.asarray(part) for part in parts))
            yield view
        self._whole = True

    @property
    def in_memory(self) -> int:
        """Bytes."""
        return self._cache.in_memory

    def keep_depths(self) -> None:
        """Forget all but depths and what is expected of them; from now on their other maps are empty."""
        for number in range(len(self._cameras)) if self._whole else ():
            kept = self._cache.get(number)
            assert kept is not None, "what is kept is not dropped before `clear`"
            none = np.zeros(0)  # of a slice, the whole would stay
            self._cache.put(number, (kept[0], none, none, none, kept[4]))

    def clear(self) -> None:
        """Forget them."""
        self._cache.clear()


def _as_bytes(color: np.ndarray) -> np.ndarray:
    return color if color.dtype == np.uint8 else np.round(255 * color).clip(0, 255).astype(np.uint8)
