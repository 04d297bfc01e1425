"""What a user may write after the verb, checked before Hydra sees it so that the sentence can be ours."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path

from room2dgs.errors import InputError

# Their values are taken as they stand: Hydra would stumble over `=`, `,` or a bracket in a folder's name.
PATH_KEYS = (
    "out",
    "scene.path",
    "scene.gt_mesh",
    "points.file",
    "points.cache",
    "prior.depth.path",
    "prior.normal.path",
    "prior.depth.onnx.model",
    "prior.normal.onnx.model",
    "prior.cache",
    "eval.gt",
    "eval.pred",
)

# Keys of earlier versions, also as they stand in an earlier run's config.yaml -> what they are called now.
RENAMED = {
    "prior.depth.square": "prior.depth.manhattan",
    "prior.depth.max_misfit": "prior.depth.max_outlier_ratio",
    "loss.normal_doubt": "loss.normal_reweighting",
}


def group_choices(conf: Path) -> dict[str, list[str]]:
    """Config group ("prior", "prior/depth") -> the names that it can be set to, from the files below `conf`.

    What begins with an underscore is a part of others and no choice.
    """
    folders = sorted(folder for folder in conf.rglob("*") if folder.is_dir() and folder.name[0] not in "._")
    return {
        folder.relative_to(conf).as_posix(): sorted(
            file.stem for file in folder.glob("*.yaml") if not file.name.startswith("_")
        )
        for folder in folders
    }


def checked_overrides(overrides: Iterable[str], keys: Iterable[str], groups: dict[str, list[str]]) -> list[str]:
    """The overrides with paths quoted for Hydra.

    Args:
        overrides: "KEY=VALUE" each.
        keys: every dotted setting.
        groups: what `group_choices` gives.

    Raises:
        InputError: not KEY=VALUE, an unknown key or an unknown choice of a group.
    """
    nodes = {part for key in keys for part in _ancestors(key)}
    result = []
    for override in overrides:
        key, equals, value = override.partition("=")
        if not equals or not key:
            raise InputError(f"{override!r} is not understood; settings are written KEY=VALUE")
        if new_name(key):
            raise InputError(f"{key} is now {new_name(key)}")
        if key in groups and key not in PATH_KEYS:
            if value not in groups[key]:
                raise InputError(f"{override} is not known; {_choose(key, value, groups[key])}")
        elif key.replace(".", "/") in groups and "." in key and not value.startswith("{"):
            raise InputError(f"{override} is not understood; write {key.replace('.', '/')}={value}")
        elif key not in nodes:
            near = difflib.get_close_matches(key, sorted(nodes | set(groups)), n=1)
            hint = f"did you mean {near[0]}" if near else "`room2dgs run --help` lists them all"
            raise InputError(f"{key} is no setting; {hint}")
        result.append(f"{key}={_quoted(value)}" if key in PATH_KEYS else override)
    return result


def new_name(key: str) -> str | None:
    """What a key of an earlier version is called now; None for any other."""
    for old, new in RENAMED.items():
        if key == old or key.startswith(old + "."):
            return new + key.removeprefix(old)
    return None


def override_keys(overrides: Iterable[str]) -> list[str]:
    """The keys that the overrides name, in order."""
    return [override.partition("=")[0] for override in overrides]


def _ancestors(key: str) -> list[str]:
    parts = key.split(".")
    return [".".join(parts[: count + 1]) for count in range(len(parts))]


def _choose(key: str, value: str, choices: list[str]) -> str:
    if value.startswith(("{", "[")):
        return f"set single values, for example {key}.NAME=VALUE"
    return f"choose from {', '.join(choices)}" if choices else f"there is no choice for {key} yet"


def _quoted(value: str) -> str:
    if value in ("", "null") or (value[0] in "'\"" and value[-1] == value[0] and len(value) > 1):
        return value
    # Hydra unescapes \' and the backslashes just before it or before the closing quote.
    escaped = []
    backslashes = 0
    for char in value:
        if char == "'":
            escaped.append("\\" * (backslashes + 1))
        escaped.append(char)
        backslashes = backslashes + 1 if char == "\\" else 0
    return "'" + "".join(escaped) + "\\" * backslashes + "'"
