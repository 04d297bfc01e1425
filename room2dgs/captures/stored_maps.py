"""Maps of many views, packed and in a cache: memory does not grow with their number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from room2dgs.captures.cache import Cache
from room2dgs.captures.packed_maps import digest, pack, unpack
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
        packed = pack(maps)
        self._known[name] = maps.source, digest(packed)
        self.cache.put((self._mine, name), packed)

    def digest(self, name: str) -> str:
        """Hex digits that stand for a view's maps."""
        return self._known[name][1]

    def __getitem__(self, name: str) -> ViewMaps[np.ndarray]:
        source, _ = self._known[name]
        packed = self.cache.get((self._mine, name))
        if packed is None:
            raise RuntimeError(f"the maps of {name} are no longer in the cache; this is a fault of room2dgs")
        return unpack(packed, source)

    def __contains__(self, name: object) -> bool:
        return name in self._known

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)
