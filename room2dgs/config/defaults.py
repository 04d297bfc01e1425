"""The defaults of all settings as one tree, taken from the fields: what conf/ only changes."""

from __future__ import annotations

import dataclasses
from typing import Any

from hydra.core.config_store import ConfigStore
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from room2dgs.config.schema import Config

NOT_GIVEN = "???"  # OmegaConf's mark of a value that must come from the user
STORED = "room2dgs_settings"  # where conf/config.yaml begins


def default_tree(kind: type = Config) -> dict[str, Any]:
    """Every setting's default below a dataclass, as plain values; `NOT_GIVEN` where the user must give one."""
    fields: dict[str, FieldInfo] = getattr(kind, "__pydantic_fields__", {})
    return {name: _default(field) for name, field in fields.items()}


def store_defaults() -> None:
    """Let Hydra begin with the defaults, under the name `STORED`; if it does already, nothing happens."""
    store = ConfigStore.instance()
    if f"{STORED}.yaml" not in store.repo:
        store.store(STORED, default_tree(), package="_global_", provider="room2dgs")


def _default(field: FieldInfo) -> Any:
    value = field.get_default(call_default_factory=True)
    if value is not PydanticUndefined:
        return _plain(value)
    return default_tree(field.annotation) if isinstance(field.annotation, type) and _is_group(field) else NOT_GIVEN


def _is_group(field: FieldInfo) -> bool:
    return dataclasses.is_dataclass(field.annotation)


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    return [_plain(one) for one in value] if isinstance(value, list) else value
