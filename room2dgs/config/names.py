"""What help says of a setting whose values are the names of a registry."""

from __future__ import annotations

from typing import Any

from room2dgs.registry import Registry


def described(question: str, registry: Registry[Any]) -> str:
    """The description of a setting: what it decides, then each name with its sentence."""
    return " ".join([question, *(f"{entry.name}: {entry.description}" for entry in registry.entries())])
