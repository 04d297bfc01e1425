"""Named things that are imported when they are used first, so that settings can be checked without torch."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from operator import attrgetter
from typing import Any, Generic, TypeVar

from room2dgs.errors import InputError, first_line
from room2dgs.logs import LOGGER

T = TypeVar("T")


@dataclass(frozen=True)
class Entry(Generic[T]):
    """One named thing.

    Attributes:
        kind: what it is, in a word or two ("layout").
        name: as settings and verbs give it.
        target: where it is, "package.module:attribute".
        description: one sentence for help and documentation.
        facts: plain values that are known without an import; which ones, the registry's file says.
        package: the installed package that brings it; None: room2dgs itself.
        attributes: what the loaded object must have.
    """

    kind: str
    name: str
    target: str
    description: str
    facts: Mapping[str, Any] = field(default_factory=dict)
    package: str | None = None
    attributes: tuple[str, ...] = ()

    def load(self) -> T:
        """Import it.

        Raises:
            InputError: an installed package brings it, and it cannot be imported or lacks one of `attributes`.
        """
        module, _, attribute = self.target.partition(":")
        if self.package is None:
            return attrgetter(attribute)(import_module(module))
        try:
            found: Any = import_module(module)
            found = attrgetter(attribute)(found) if attribute else found
        except Exception as error:  # whatever somebody else's module does at import
            raise self._broken(f"cannot be imported ({type(error).__name__}: {first_line(error)})") from error
        missing = [name for name in self.attributes if not hasattr(found, name)]
        if missing:
            raise self._broken(f"has no {' and no '.join(missing)} ({self.target})")
        return found

    def _broken(self, what: str) -> InputError:
        return InputError(f"{self.kind} {self.name} of the package {self.package} {what}; repair or uninstall it")


class Registry(Generic[T]):
    """The list of all things of one kind, in a fixed order.

    Entry points of installed packages follow the registry's own entries; nothing of them is imported before
    `Entry.load`. An entry point whose name is taken is left out, and a warning says so.
    """

    def __init__(self, kind: str, group: str | None = None, attributes: tuple[str, ...] = ()) -> None:
        """Start an empty list.

        Args:
            kind: what an entry is, in a word or two, for error messages.
            group: of entry points ("room2dgs.readers"); None: other packages cannot add to the list.
            attributes: what an object that an entry point names must have.
        """
        self.kind = kind
        self.group = group
        self.attributes = attributes
        self._own: dict[str, Entry[T]] = {}

    def register(self, name: str, target: str, description: str, **facts: Any) -> None:
        """Add an entry at the end; see `Entry`.

        Raises:
            ValueError: the name is taken.
        """
        if name in self._own:
            raise ValueError(f"{self.kind} {name} is registered twice")
        self._own[name] = Entry(self.kind, name, target, description, facts)

    def entries(self) -> tuple[Entry[T], ...]:
        """All of them, ours first."""
        return tuple(self._all().values())

    def names(self) -> tuple[str, ...]:
        """Their names, in the same order."""
        return tuple(self._all())

    def get(self, name: str) -> Entry[T]:
        """The entry of a name.

        Raises:
            InputError: there is none; the message names the nearest one and lists all.
        """
        found = self._all()
        if name not in found:
            raise InputError(self.unknown(name))
        return found[name]

    def load(self, name: str) -> T:
        """The thing itself: `get(name).load()`.

        Raises:
            InputError: as `get` and `Entry.load`.
        """
        return self.get(name).load()

    def unknown(self, name: object) -> str:
        """The sentence about a name that is none, with the nearest one."""
        near = difflib.get_close_matches(str(name), self.names(), n=1)
        guess = f" (did you mean {near[0]}?)" if near else ""
        return f"{self.kind} {str(name)!r} is not known{guess}; choose from {', '.join(self.names())}"

    def __contains__(self, name: object) -> bool:
        return name in self._all()

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def _all(self) -> dict[str, Entry[T]]:
        if self.group is None:
            return self._own
        found = dict(self._own)
        for point in _entry_points(self.group, tuple(sys.path)):
            package = point.dist.name if point.dist else "?"
            if point.name in found:
                _say_taken(self.kind, point.name, package, found[point.name].package or "room2dgs")
                continue
            said = f"Comes from the installed package {package}."
            found[point.name] = Entry(self.kind, point.name, point.value, said, {}, package, self.attributes)
        return found


@lru_cache
def _entry_points(group: str, _path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Of the packages that are installed along a path, which is `sys.path`."""
    return tuple(entry_points(group=group))


@lru_cache
def _say_taken(kind: str, name: str, package: str, owner: str) -> None:
    """Once a process."""
    LOGGER.warning(f"warning: {kind} {name} of the package {package} is left out: {owner} has one of this name")
