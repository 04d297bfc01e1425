"""What a user may write after the verb, checked before Hydra sees it so that the sentence can be ours."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from room2dgs.config.keys import leaf_keys, path_keys
from room2dgs.config.sentences import no_setting
from room2dgs.errors import InputError

DOLLAR = re.compile(r"(\\*)\$\{")
# Keys of earlier versions, also as they stand in an earlier run's config.yaml -> what they are called now.
RENAMED = {
    "prior.depth.square": "prior.depth.manhattan",
    "prior.depth.second_look": "prior.depth.second_pass",
    "loss.normal_doubt": "loss.normal_reweighting",
    "stereo.neighbours": "stereo.num_source_views",
    "stereo.best": "stereo.top_k",
    "stereo.asked": "stereo.consistency_views",
    "stereo.min_agreeing": "stereo.min_num_consistent",
    "stereo.max_px": "stereo.max_reprojection_px",
    "stereo.max_relative": "stereo.max_relative_difference",
    "report.discs": "report.max_surfels",
    **{
        f"prior.{kind}.onnx.{name}": f"prior.{kind}.{name}"
        for kind in ("depth", "normal")
        for name in ("model", "error_scale", "max_error")
    },
}
# And those that nothing takes the place of, with all below them -> why.
GONE = {
    **dict.fromkeys(
        ("prior.depth.max_misfit", "prior.depth.max_outlier_ratio", "prior.depth.max_residual"),
        "depth is trusted pixel by pixel now, by prior.depth.completion",
    ),
    **dict.fromkeys(
        ("train.exposure", "train.rates.exposure"),
        "scene.exposure finds exposures before the training, from all photos",
    ),
    "prior.depth.relief": "planes do not bend, which no capture showed to help",
    "mesh.min_confidence": "mesh.max_expected_m says in metres what is left out",
    "prior.depth.onnx": "the card beside the model says it, or prior.depth.card=FILE",
    "prior.normal.onnx": "the card beside the model says it, or prior.normal.card=FILE",
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


def checked_overrides(overrides: Iterable[str], groups: dict[str, list[str]]) -> list[str]:
    """The overrides with paths quoted for Hydra.

    Args:
        overrides: "KEY=VALUE" each.
        groups: what `group_choices` gives.

    Raises:
        InputError: not KEY=VALUE, an unknown key or an unknown choice of a group.
    """
    return [_checked(override, groups) for override in overrides]


def known_key(override: str, groups: dict[str, list[str]]) -> str:
    """The key of "KEY=VALUE": a setting, a group of settings or a Hydra group.

    Raises:
        InputError: not KEY=VALUE, or an unknown key.
    """
    key, equals, _ = override.partition("=")
    if not equals or not key:
        raise InputError(f"{override!r} is not understood; settings are written KEY=VALUE")
    if new_name(key):
        raise InputError(f"{key} is now {new_name(key)}")
    if why := why_gone(key):
        raise InputError(f"{key} is gone: {why}; leave it out")
    nodes = {part for known in leaf_keys() for part in _ancestors(known.name)} | set(groups)
    if key not in nodes:
        raise InputError(no_setting(key, nodes))
    return key


def override_keys(overrides: Iterable[str]) -> list[str]:
    """The keys that the overrides name, in order."""
    return [override.partition("=")[0] for override in overrides]


def new_name(key: str) -> str | None:
    """What a key of an earlier version is called now; None for any other."""
    for old, new in RENAMED.items():
        if key == old or key.startswith(old + "."):
            return new + key.removeprefix(old)
    return None


def why_gone(key: str) -> str | None:
    """Why a key of an earlier version has nothing in its place; None for any other."""
    return next((why for old, why in GONE.items() if key == old or key.startswith(old + ".")), None)


def without_paths(overrides: Iterable[str]) -> tuple[list[str], list[str]]:
    """The overrides for Hydra, and those of paths, which are no business of its grammar."""
    parts: tuple[list[str], list[str]] = ([], [])
    for text in overrides:
        parts[text.partition("=")[0] in path_keys()].append(text)
    return parts


def path_of(value: str) -> str | None:
    """The path that a value on the command line means; None for `null`."""
    return None if value == "null" else unquoted(value)


def quoted(value: str) -> str:
    """A path as Hydra reads it back unchanged; what is quoted already, empty or `null` stays."""
    if value in ("", "null") or _is_quoted(value):
        return value
    value = DOLLAR.sub(lambda found: "\\" * (2 * len(found[1]) + 1) + "${", value)  # else an interpolation
    # Hydra unescapes \' and the backslashes just before it or before the closing quote.
    escaped = []
    backslashes = 0
    for char in value:
        if char == "'":
            escaped.append("\\" * (backslashes + 1))
        escaped.append(char)
        backslashes = backslashes + 1 if char == "\\" else 0
    return "'" + "".join(escaped) + "\\" * backslashes + "'"


def unquoted(value: str) -> str:
    """The way back from `quoted`; text without quotes around it stays."""
    if not _is_quoted(value):
        return value
    mark = value[0]
    inside = re.sub(rf"(\\+)({mark}|$)", lambda found: found[1][: len(found[1]) // 2] + found[2], value[1:-1])
    return DOLLAR.sub(lambda found: found[1][: len(found[1]) // 2] + "${", inside)


def _is_quoted(value: str) -> bool:
    return len(value) > 1 and value[0] in "'\"" and value[-1] == value[0]


def _checked(override: str, groups: dict[str, list[str]]) -> str:
    key, value = known_key(override, groups), override.partition("=")[2]
    if key in path_keys():
        return f"{key}={quoted(value)}"
    if key in groups and value not in groups[key]:
        raise InputError(f"{override} is not known; {_choose(key, value, groups[key])}")
    if "." in key and key.replace(".", "/") in groups and not value.startswith("{"):
        raise InputError(f"{override} is not understood; write {key.replace('.', '/')}={value}")
    return override


def _ancestors(key: str) -> list[str]:
    parts = key.split(".")
    return [".".join(parts[: count + 1]) for count in range(len(parts))]


def _choose(key: str, value: str, choices: list[str]) -> str:
    if value.startswith(("{", "[")):
        return f"set single values, for example {key}.NAME=VALUE"
    return f"choose from {', '.join(choices)}" if choices else f"there is no choice for {key} yet"
