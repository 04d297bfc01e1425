"""Stages of a long job: what is finished is kept, and done again only if what it depends on changed."""

from __future__ import annotations

import hashlib
import json
import time
from pathlib import Path
from typing import Any

from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.json_files import plain, read_json
from room2dgs.logs import Log

REPORT_SECONDS = 8.0
# Raise it when a stage would come out differently from the same input.
FORMAT = 2


def key_of(*parts: Any) -> str:
    """Sixteen hex digits that stand for some plain values."""
    return hashlib.sha256(json.dumps(plain([FORMAT, *parts]), sort_keys=True).encode()).hexdigest()[:16]


class Stages:
    """Results of stages as JSON files in a folder, each with the key of what it was made from."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def found(self, name: str, key: str) -> dict[str, Any] | None:
        """What a finished stage left, if it was made from the same."""
        try:
            known = read_json(self._path(name))
        except InputError:
            return None
        if known.get("key") != key or not isinstance(known.get("result"), dict):
            return None
        return known["result"]

    def finished(self, name: str, key: str, result: dict[str, Any]) -> dict[str, Any]:
        """Keep a stage's result, which is given back as a later `found` gives it."""
        text = json.dumps({"key": key, "result": plain(result)}, allow_nan=False)
        with whole_file(self._path(name)) as temporary:
            temporary.write_text(text, encoding="utf-8")
        return json.loads(text)["result"]

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.json"


class Progress:
    """A line every few seconds while something goes on."""

    def __init__(self, log: Log, what: str, total: int | None, unit: str) -> None:
        self.log, self.what, self.total, self.unit = log, what, total, unit
        self.start = self.last = time.monotonic()

    def at(self, count: int) -> None:
        """So many are done."""
        now = time.monotonic()
        if now - self.last < REPORT_SECONDS:
            return
        self.last = now
        of = f" of {self.total}" if self.total else ""
        left = ""
        if self.total and count:
            left = f", about {(now - self.start) / count * max(0, self.total - count):.0f} s left"
        self.log(f"{self.what}: {count}{of} {self.unit}{left}")
