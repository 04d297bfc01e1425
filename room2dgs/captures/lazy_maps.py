"""Maps of many views that are computed on access: one at a time is in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TypeVar

Map = TypeVar("Map")


class LazyMaps(Mapping[str, Map]):
    """View name -> what a function gives; it is called each time."""

    def __init__(self) -> None:
        self._makers: dict[str, Callable[[], Map]] = {}

    def add(self, name: str, make: Callable[[], Map]) -> None:
        """Take a view's function, in place of an earlier one."""
        self._makers[name] = make

    def __getitem__(self, name: str) -> Map:
        return self._makers[name]()

    def __contains__(self, name: object) -> bool:
        return name in self._makers

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)
