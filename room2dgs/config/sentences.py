"""What pydantic, Hydra and OmegaConf say of wrong settings, as one sentence that names the setting."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from typing import Any

from pydantic import ValidationError

from room2dgs.config.keys import Key, leaf_keys

UNKNOWN = ("unexpected_keyword_argument", "extra_forbidden")
IMPOSSIBLE = (
    "greater_than",
    "greater_than_equal",
    "less_than_equal",
    "finite_number",
    "too_short",
    "too_long",
    "string_pattern_mismatch",
)


def of_validation(error: ValidationError, overrides: Sequence[str]) -> str:
    """The sentence about the first setting that is wrong; what is missing comes before what is wrong.

    Args:
        overrides: "KEY=VALUE" each, as the user wrote them.
    """
    errors = sorted(error.errors(include_url=False), key=lambda one: (one["type"] != "missing", _rank(one["type"])))
    first = errors[0]
    name, key, places = _found(first["loc"])
    kind = first["type"]
    if kind == "missing":
        return not_given(name)
    if kind in UNKNOWN:
        return no_setting(name, (key.name for key in leaf_keys()))
    if kind == "value_error":
        return str(first["ctx"]["error"]).replace("{key}", name)
    if key and kind == "literal_error":
        return f"{name}={shown(first['input'])} is not known; {key.allowed}"
    if key and kind in IMPOSSIBLE:
        return f"{name}={shown(first['input'])} is impossible; {_bound(first, key, places)}"
    text = next((text for text in reversed(overrides) if text.startswith(name + "=")), f"{name}={first['input']}")
    return f"{text} does not fit; {name} wants {key.wants if key else 'settings of its own, KEY=VALUE each'}"


def not_given(name: str) -> str:
    """The sentence about a setting that has to be given."""
    return f"{name} is not given; add {name}={'DIR' if name in ('out', 'scene.path') else '...'}"


def of_composition(error: Exception) -> str:
    """Hydra's and OmegaConf's many lines as one."""
    lines = [line.strip() for line in str(error.__cause__ or error).splitlines() if line.strip()]
    full_key = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("full_key:")), "")
    return f"configuration: {lines[0]}" + (f" ({full_key})" if full_key else "")


def no_setting(key: str, names: Iterable[str]) -> str:
    """The sentence about an unknown key, with the nearest of the known names."""
    near = difflib.get_close_matches(key, sorted(names), n=1)
    return f"{key} is no setting; {f'did you mean {near[0]}' if near else '`room2dgs run --help` lists them all'}"


def shown(value: Any) -> str:
    """A value as it is written on the command line."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return "[" + ",".join(shown(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{" + ",".join(f"{key}:{shown(item)}" for key, item in value.items()) + "}"
    return str(value)


def _found(place: tuple[int | str, ...]) -> tuple[str, Key | None, tuple[int | str, ...]]:
    """Where pydantic found it -> the dotted name, the setting that it is or lies in, and the places inside that."""
    keys = {key.name: key for key in leaf_keys()}
    for end in range(1, len(place) + 1):
        name = ".".join(map(str, place[:end]))
        if name in keys:
            inside = tuple(part for part in place[end:] if not _is_type(part))  # of a union's members
            steps = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in inside)
            return name + "".join(steps), keys[name], inside
    return ".".join(map(str, place)), None, ()


def _is_type(part: int | str) -> bool:
    return part in ("int", "float", "bool", "str") or str(part).startswith(("literal[", "constrained-", "function-"))


def _rank(kind: str) -> int:
    """Of a number's two errors, that it is none and that it is not finite, the latter says more."""
    return 0 if kind in IMPOSSIBLE else 1


def _bound(error: Any, key: Key, places: tuple[int | str, ...]) -> str:
    """What is allowed; for a field inside a list's item, the bound that was broken."""
    words = {
        "greater_than": "above {gt}",
        "greater_than_equal": "of {ge} or more",
        "less_than_equal": "of at most {le}",
    }
    inside_item = bool(places) and isinstance(places[-1], str)
    if inside_item and error["type"] in words:
        return f"give a value {words[error['type']].format(**error['ctx'])}"
    return key.allowed
