"""Settings as keyword arguments: `scene__image_width=320`, `mesh={"voxel_m": 0.02}`, `prior="room_prior"`."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from typing import Any

from room2dgs.config import conf_dir
from room2dgs.config.keys import leaf_keys, path_keys
from room2dgs.config.overrides import group_choices, known_key, quoted
from room2dgs.errors import InputError

PLAIN = re.compile(r"[A-Za-z_][\w./:+-]*")  # text that Hydra takes for text without quotes
OTHERWISE = ("null", "true", "false", "nan", "inf")  # unless it is one of these


def overrides_of(settings: Mapping[str, Any]) -> list[str]:
    """The settings as they are typed after a command: "KEY=VALUE" each.

    Args:
        settings: key -> value. A key is dotted, or has two underscores for each dot; a value is one of a setting, a
            mapping of more keys, or the name of a file of conf/ where the key is one of its folders.

    Raises:
        InputError: an unknown key, or a value of a kind that no setting has.
    """
    groups = group_choices(conf_dir())
    leaves = {key.name for key in leaf_keys()}
    result = []
    for key, value in _flat(settings, leaves):
        group = key.replace(".", "/")
        if group in groups and isinstance(value, str):
            result.append(f"{group}={value}")
            continue
        known_key(f"{key}=", groups)
        is_path = key in path_keys() and isinstance(value, str | os.PathLike)
        result.append(f"{key}={os.fspath(value) if is_path else _text(key, value)}")
    return result


def _flat(settings: Mapping[str, Any], leaves: set[str], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and values of all that are no mappings of more keys."""
    for name, value in settings.items():
        key = prefix + str(name).replace("__", ".")
        if isinstance(value, Mapping) and key not in leaves:
            yield from _flat(value, leaves, f"{key}.")
        else:
            yield key, value


def _text(key: str, value: Any) -> str:
    """A value in Hydra's grammar."""
    if hasattr(value, "tolist"):  # numpy's numbers and arrays
        value = value.tolist()
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, str):
        return value if PLAIN.fullmatch(value) and value.lower() not in OTHERWISE else quoted(value) or "''"
    if isinstance(value, list | tuple):
        return f"[{','.join(_text(key, one) for one in value)}]"
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{name}:{_text(key, one)}" for name, one in value.items()) + "}"
    raise InputError(f"{key} is {value!r}, which no setting can be; give a number, a text, true or false, or a list")
