"""Results of the stages of a long job: a stage is done again only if what it depends on changed."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.json_files import plain, read_json

# Raise it when a stage would come out differently from the same input.
FORMAT = 3


def key_of(*parts: Any) -> str:
    """Sixteen hex digits that stand for some plain values."""
    return hashlib.sha256(json.dumps(plain([FORMAT, *parts]), sort_keys=True).encode()).hexdigest()[:16]


class StageCache:
    """Results of finished stages as JSON files in a folder, each with the key of what it was made from."""

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
