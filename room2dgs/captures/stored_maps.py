"""Compressed maps of many views in a cache, so that memory does not grow with their number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from room2dgs.captures.cache import Cache
from room2dgs.captures.packed_maps import Packed, digest, pack, unpack
from room2dgs.captures.view_maps import ViewMaps


class StoredMaps(Mapping[str, ViewMaps[np.ndarray]]):
    """View name -> maps, rounded as `packed_maps` says and unpacked anew each time they are asked for.

    Attributes:
        cache: where they lie.
    """

    def __init__(self, cache: Cache | None = None) -> None:
        self.cache = Cache() if cache is None else cache
        self._mine = object()  # tells its keys from those of others
        self._known: dict[str, tuple[str, str]] = {}  # name -> source, digest

    def put(self, name: str, maps: ViewMaps[np.ndarray]) -> None:
        """Take a view's maps, in place of earlier ones.

        Raises:
            InputError: the disk refuses (`Cache.put`).
        """
        self.put_packed(name, pack(maps), maps.source)

    def put_packed(self, name: str, packed: Packed, source: str) -> None:
        """Take a view's maps as `packed` gave them.

        Raises:
            InputError: the disk refuses (`Cache.put`).
        """
        self._known[name] = source, digest(packed)
        self.cache.put((self._mine, name), packed)

    def packed(self, name: str) -> Packed:
        """A view's maps in the bytes that they are kept in."""
        packed = self.cache.get((self._mine, name))
        if packed is None:
            raise RuntimeError(f"the maps of {name} are no longer in the cache; this is a fault of room2dgs")
        depth, depth_confidence, normal, normal_confidence = packed
        return depth, depth_confidence, normal, normal_confidence

    def source(self, name: str) -> str:
        """What made a view's maps."""
        return self._known[name][0]

    def digest(self, name: str) -> str:
        """Hex digits that stand for a view's maps."""
        return self._known[name][1]

    def __getitem__(self, name: str) -> ViewMaps[np.ndarray]:
        source = self.source(name)  # first: a KeyError where there is none
        return unpack(self.packed(name), source)

    def __contains__(self, name: object) -> bool:
        return name in self._known

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)
