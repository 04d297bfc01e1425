"""Cards of the networks that tests make."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import yaml

from room2dgs.config import conf_dir
from room2dgs.config.card import FOLDER, CardInput
from room2dgs.depth.network.card import IN_CARD

INPUTS = {field.name for field in fields(CardInput)}
MEANING: dict[str, dict[str, Any]] = {"depth": {"meaning": "relative_inverse_depth"}, "normal": {}}
TOP = ("get", "sha256", "licence")


def write_card(path: Path, kind: str, settings: Mapping[str, Any], base: str | None = None) -> Path:
    """Write a card of a network with one kind of map.

    Args:
        kind: "depth" or "normal".
        settings: by their names in `NetworkFormat`, or keys of the card; a text is read as YAML.
        base: a known network, from whose card all else is taken.
    """
    card = (
        json.loads((conf_dir() / FOLDER / f"{base}.json").read_text())
        if base
        else {"card": 1, "input": {}, kind: MEANING[kind].copy()}
    )
    for name, value in settings.items():
        place = IN_CARD.get(name, f"input.{name}" if name in INPUTS else name).format(kind)
        *part, key = (place if name in TOP or "." in place else f"{kind}.{place}").split(".")
        (card[part[0]] if part else card)[key] = yaml.safe_load(value) if isinstance(value, str) else value
    path.write_text(json.dumps(card))
    return path
