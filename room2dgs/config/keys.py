"""The settings' names: which exist, what type each wants, what the comment beside it says."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import types
import typing
from dataclasses import dataclass

_WORDS = {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}


@dataclass(frozen=True)
class Key:
    """One setting.

    Attributes:
        name: dotted, as it is overridden ("train.rates.center").
        wants: the type in words ("a whole number or null").
        comment: what the dataclass says beside the field, or an empty string.
    """

    name: str
    wants: str
    comment: str


def leaf_keys(schema: type, prefix: str = "") -> list[Key]:
    """Every setting below `schema`, a config dataclass, in the order of its fields."""
    hints = typing.get_type_hints(schema)
    comments = _field_comments(schema)
    keys = []
    for field in dataclasses.fields(schema):
        name = prefix + field.name
        if dataclasses.is_dataclass(hints[field.name]):
            keys += leaf_keys(hints[field.name], name + ".")
        else:
            keys.append(Key(name, _in_words(hints[field.name]), comments.get(field.name, "")))
    return keys


def _in_words(hint: object) -> str:
    """`int | None` -> "a whole number or null"."""
    if isinstance(hint, types.UnionType) or typing.get_origin(hint) is typing.Union:
        inner = [_in_words(part) for part in typing.get_args(hint) if part is not type(None)]
        return " or ".join([*inner, "null"])
    if typing.get_origin(hint) is list:
        (item,) = typing.get_args(hint)
        if dataclasses.is_dataclass(item):
            example = ",".join(f"{field.name}:..." for field in dataclasses.fields(item))
            return f"a list such as [{{{example}}}]"
        return "a list such as [a,b]" if item is str else "a list such as [0.1,0.2]"
    return _WORDS.get(hint, str(hint))


@functools.cache
def _field_comments(schema: type) -> dict[str, str]:
    """Field name -> the comment at the end of its line."""
    found = {}
    for line in inspect.getsource(schema).splitlines():
        code, mark, comment = line.partition("#")
        name, colon, _ = code.strip().partition(":")
        if mark and colon and name.isidentifier():
            found[name] = comment.strip()
    return found
