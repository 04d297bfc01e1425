"""Texts for others to read: no folders of the machine that a run was made on."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from functools import reduce
from pathlib import Path

from room2dgs.config import Config
from room2dgs.config.keys import path_keys
from room2dgs.runs.folder import value_at
from room2dgs.runs.verdict import Verdict


def named_only(config: Config) -> Config:
    """The settings with the last name of each absolute path alone."""
    config = deepcopy(config)
    for key in path_keys():
        *parents, name = key.split(".")
        value = value_at(config, key)
        if value and Path(value).is_absolute():
            setattr(reduce(getattr, parents, config), name, Path(value).name)
    return config


class Places:
    """Takes a run's folders, those of its settings, and the user's home out of texts."""

    def __init__(self, config: Config) -> None:
        names: dict[str, str] = {}
        for key in path_keys():
            value = value_at(config, key)
            if value and Path(value).is_absolute() and Path(value).name:
                path = Path(value)
                names |= {str(path): path.name, f"{path.parent}/": ""}
        names |= {str(Path.home()): "~"}
        names = {path: name for path, name in names.items() if len(path) > 1}
        self._names: Mapping[str, str] = dict(sorted(names.items(), key=lambda item: -len(item[0])))

    def out_of(self, text: str) -> str:
        """The text with names in place of paths."""
        for path, name in self._names.items():
            text = text.replace(path, name)
        return text

    def out_of_all(self, texts: list[str]) -> list[str]:
        return [self.out_of(text) for text in texts]

    def out_of_verdict(self, verdict: Verdict | None) -> Verdict | None:
        if verdict is None:
            return None
        reasons, advice, notes = (
            tuple(map(self.out_of, texts)) for texts in (verdict.reasons, verdict.advice, verdict.notes)
        )
        return replace(verdict, reasons=reasons, advice=advice, notes=notes)
