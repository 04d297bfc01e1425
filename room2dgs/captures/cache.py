"""A cache of photos and maps with a memory budget: the least recently used are written to the disk."""

from __future__ import annotations

import itertools
import shutil
import tempfile
from collections import OrderedDict
from collections.abc import Callable, Hashable
from pathlib import Path
from threading import RLock

import numpy as np

from room2dgs.errors import InputError

DEFAULT_MB = 1500.0
Arrays = tuple[np.ndarray, ...]


class Cache:
    """Tuples of arrays by key; the same bits come back whatever the budget.

    Files are the process's own: they are read and not mapped (mapped pages would count as memory), nothing reads one
    that was not written whole by this object, and `clear` removes them. Arrays are shared with the cache: whoever
    gets them does not write to them. Threads may use it together.

    Args:
        budget_mb: 10^6 bytes of arrays that stay in memory; what is in use outside the cache is not counted.
    """

    def __init__(self, budget_mb: float = DEFAULT_MB) -> None:
        self._budget = int(budget_mb * 1e6)
        self._used = 0
        self._kept: OrderedDict[Hashable, Arrays] = OrderedDict()
        self._files: dict[Hashable, Path] = {}
        self._again: set[Hashable] = set()  # keys that are made again rather than written
        self._folder: Path | None = None
        self._temporary: tempfile.TemporaryDirectory | None = None
        self._names = (f"{number:07d}.npy" for number in itertools.count())
        self._lock = RLock()

    def use_folder(self, folder: Path) -> None:
        """Where to write from now on; what a killed process left there goes. Without one: the system's folder."""
        shutil.rmtree(folder, ignore_errors=True)
        self._folder = folder

    def put(self, key: Hashable, arrays: Arrays, write: bool = True) -> None:
        """Keep arrays under a key, in place of what was there.

        Args:
            write: to the disk when the budget asks for room; False: forget them then.

        Raises:
            InputError: the disk refuses.
        """
        with self._lock:
            self.discard(key)
            self._kept[key] = arrays
            self._used += _size(arrays)
            if not write:
                self._again.add(key)
            self._make_room()

    def get(self, key: Hashable) -> Arrays | None:
        """What was put under a key; None if nothing was, or it was forgotten."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
            path = self._files.get(key)
            if path is None:
                return None
            arrays = _read(path)
            self._kept[key] = arrays
            self._used += _size(arrays)
            self._make_room()
            return arrays

    def get_or(self, key: Hashable, make: Callable[[], Arrays], write: bool = True) -> Arrays:
        """What was put under a key, else what `make` gives, which is then kept."""
        arrays = self.get(key)
        if arrays is None:
            arrays = make()
            self.put(key, arrays, write)
        return arrays

    def discard(self, key: Hashable) -> None:
        """Forget what is under a key, if anything is."""
        with self._lock:
            self._used -= _size(self._kept.pop(key, ()))
            self._again.discard(key)
            path = self._files.pop(key, None)
            if path is not None:
                path.unlink(missing_ok=True)

    @property
    def in_memory(self) -> int:
        """Bytes."""
        return self._used

    def has_room(self, size: int) -> bool:
        """Whether so many bytes more would displace nothing."""
        return self._used + size <= self._budget

    def clear(self) -> None:
        """Forget everything and remove the files."""
        with self._lock:
            self._kept.clear()
            self._again.clear()
            self._used = 0
            for path in self._files.values():
                path.unlink(missing_ok=True)
            self._files.clear()
            if self._folder is not None:
                shutil.rmtree(self._folder, ignore_errors=True)

    def _make_room(self) -> None:
        while self._used > self._budget:
            key, arrays = self._kept.popitem(last=False)
            self._used -= _size(arrays)
            if key in self._again:
                self._again.discard(key)
            elif key not in self._files:
                self._files[key] = self._written(arrays)

    def _written(self, arrays: Arrays) -> Path:
        try:
            if self._folder is None:
                self._temporary = self._temporary or tempfile.TemporaryDirectory(prefix="room2dgs-")
                folder = Path(self._temporary.name)
            else:
                folder = self._folder
                folder.mkdir(parents=True, exist_ok=True)
            path = folder / next(self._names)
            with path.open("wb") as file:
                for array in arrays:
                    np.save(file, array)
        except OSError as error:
            raise InputError(
                f"photos and maps beyond memory.cache_mb cannot be written to {folder} ({error.strerror}); "
                "free some space or raise memory.cache_mb"
            ) from error
        return path


def _read(path: Path) -> Arrays:
    arrays = []
    size = path.stat().st_size
    with path.open("rb") as file:
        while file.tell() < size:
            arrays.append(np.load(file, allow_pickle=False))
    return tuple(arrays)


def _size(arrays: Arrays) -> int:
    return sum(array.nbytes for array in arrays)
