"""The settings' names: which exist, what each takes, what it means; all read from the fields."""

from __future__ import annotations

import dataclasses
import functools
import types
import typing
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from annotated_types import Ge, Gt, Le
from pydantic.fields import FieldInfo

from room2dgs.config.defaults import default_tree
from room2dgs.config.fields import IsPath, Name, Wants
from room2dgs.config.schema import Config

_WORDS = {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}


@dataclass(frozen=True)
class Key:
    """One setting.

    Attributes:
        name: dotted, as it is overridden ("train.rates.center").
        wants: the type in words ("a whole number or null").
        allowed: what to write in place of an impossible value ("choose from a, b"; "give a value of 1 or more").
        comment: what it decides, in whole sentences.
        default: its value where nobody gives one, as OmegaConf has it ("???": it must be given).
        public: every help shows it; the others are for experts.
        is_path: it names a file or folder.
        choices: the values of a single-valued setting that has only so many; else empty.
    """

    name: str
    wants: str
    allowed: str
    comment: str
    default: Any
    public: bool
    is_path: bool
    choices: tuple[str, ...]


@functools.cache
def leaf_keys() -> tuple[Key, ...]:
    """Every setting, in the order of the fields."""
    return tuple(_leaves(Config, "", "", default_tree()))


def _leaves(schema: Any, prefix: str, called: str, defaults: Mapping[str, Any]) -> Iterator[Key]:
    """The settings below a dataclass.

    Args:
        called: what stands for "{term}" in their descriptions.
        defaults: of its fields.
    """
    fields: dict[str, FieldInfo] = schema.__pydantic_fields__
    for name, field in fields.items():
        marks = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        if dataclasses.is_dataclass(field.annotation):
            yield from _leaves(field.annotation, f"{prefix}{name}.", str(marks.get("called", "")), defaults[name])
            continue
        hints = list(_hints(field.annotation, field.metadata))
        is_path = any(isinstance(mark, IsPath) for mark in hints)
        words = _in_words(field.annotation, field.metadata)
        comment = (field.description or "").replace("{term}", called)
        allowed, choices = _allowed(hints, words), _single_choices(words, hints)
        yield Key(prefix + name, words, allowed, comment, defaults[name], bool(marks.get("public")), is_path, choices)


@functools.cache
def path_keys() -> tuple[str, ...]:
    """The settings that name a file or folder. Their values are taken as they stand: Hydra would stumble over `=`,
    `,` or a bracket in a folder's name."""
    return tuple(key.name for key in leaf_keys() if key.is_path)


def _hints(hint: Any, metadata: Iterable[Any] = ()) -> Iterator[Any]:
    """The marks of a type and of all types inside it, outermost first, with the `Literal`s among them."""
    for mark in metadata:
        yield from getattr(mark, "metadata", (mark,))
    origin = typing.get_origin(hint)
    if origin is typing.Annotated:
        inner, *marks = typing.get_args(hint)
        yield from _hints(inner, marks)
    elif origin is Literal:
        yield hint
    elif not dataclasses.is_dataclass(hint):
        for inner in typing.get_args(hint):
            yield from _hints(inner)


def _in_words(hint: Any, metadata: Iterable[Any] = ()) -> str:
    """`int | None` -> "a whole number or null"."""
    marks = list(metadata)
    wants = next((mark.words for mark in marks if isinstance(mark, Wants)), None)
    names = next((mark.known() for mark in marks if isinstance(mark, Name)), None)
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if wants:
        words = wants
    elif names is not None:
        words = f"one of {', '.join(names)}"
    elif origin is typing.Annotated:
        words = _in_words(inner[0], inner[1:])
    elif origin in (types.UnionType, typing.Union):
        words = " or ".join([*(_in_words(part) for part in inner if part is not type(None)), "null"])
    elif origin is Literal:
        words = f"one of {', '.join(inner)}"
    elif origin is list:
        words = f"a list such as [{_example(inner[0])}]"
    else:
        words = _WORDS.get(hint, str(hint))
    return words


def _example(item: Any) -> str:
    """What may stand in a list."""
    if dataclasses.is_dataclass(item):
        return "{" + ",".join(f"{field.name}:..." for field in dataclasses.fields(item)) + "}"
    return "0.1,0.2" if item in (int, float) or typing.get_args(item)[:1] in ((int,), (float,)) else "a,b"


def _choices(hints: list[Any]) -> tuple[str, ...]:
    for mark in hints:
        if isinstance(mark, Name):
            return mark.known()
        if typing.get_origin(mark) is Literal:
            return typing.get_args(mark)
    return ()


def _single_choices(words: str, hints: list[Any]) -> tuple[str, ...]:
    if words.startswith("true or false"):
        return ("true", "false")
    return () if words.startswith("a list") else _choices(hints)


def _allowed(hints: list[Any], words: str) -> str:
    if any(isinstance(mark, Wants) for mark in hints):
        return f"give {words}"
    choices = _choices(hints)
    if choices:
        return f"choose from {', '.join(choices)}"
    low = next((mark.ge for mark in hints if isinstance(mark, Ge)), None)
    above = next((mark.gt for mark in hints if isinstance(mark, Gt)), None)
    high = next((mark.le for mark in hints if isinstance(mark, Le)), None)
    if low is not None and high is not None:
        return f"give a value from {low} to {high}"
    if low is not None:
        return f"give a value of {low} or more"
    if above is not None:
        return f"give a value above {above}" + ("" if high is None else f" and at most {high}")
    return f"give {words}"
