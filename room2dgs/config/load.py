"""From defaults, conf/ and overrides to a validated `Config`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import TypeAdapter, ValidationError

from room2dgs.config import sentences
from room2dgs.config.card import with_conventions
from room2dgs.config.composing import composed
from room2dgs.config.defaults import NOT_GIVEN
from room2dgs.config.folder import conf_dir
from room2dgs.config.groups.prior import NETWORK_SOURCES
from room2dgs.config.keys import leaf_keys, path_keys
from room2dgs.config.overrides import (
    RENAMED,
    checked_overrides,
    group_choices,
    override_keys,
    path_of,
    why_gone,
    without_paths,
)
from room2dgs.config.saved import as_yaml, no_configuration, read_saved
from room2dgs.config.schema import Config
from room2dgs.errors import InputError, first_line

Tree = dict[str, Any]


def load_config(overrides: Sequence[str] = (), earlier: Path | None = None) -> Config:
    """Compose and validate.

    Args:
        overrides: Hydra overrides, e.g. ["scene.path=room", "train.iterations=100"]. Paths are text, whatever they
            look like: nothing in them is resolved.
        earlier: config.yaml of an earlier run; it gives every setting that no override names.

    Raises:
        InputError: unknown key, wrong type, missing or impossible value; the sentence names the key.
    """
    checked = checked_overrides(overrides, group_choices(conf_dir()))
    for_hydra, paths = without_paths(checked)
    try:
        values: Any = OmegaConf.to_container(composed(for_hydra), resolve=True)
    except (HydraException, OmegaConfBaseException) as error:
        raise InputError(sentences.of_composition(error)) from error
    except (RecursionError, ValueError) as error:
        raise InputError(f"configuration: a value cannot be read ({first_line(error)}); write it shorter") from error
    if earlier is not None:
        values = _on_top_of(earlier, values, override_keys(checked))
    _check_given(values, override_keys(paths))
    values = _given(values)
    for override in paths:
        key, _, text = override.partition("=")
        _put(values, key, path_of(text))
    try:
        config = TypeAdapter(Config).validate_python(values)
        return replace(config, prior=with_conventions(config.prior, NETWORK_SOURCES))
    except ValidationError as error:
        raise InputError(sentences.of_validation(error, overrides)) from error


def dump_config(config: Config) -> str:
    """The configuration as YAML."""
    return as_yaml(asdict(config))


def _on_top_of(earlier: Path, tree: Tree, chosen: list[str]) -> Tree:
    """The earlier run's settings with the chosen keys (settings or whole groups) taken from `tree`.

    Settings that did not exist yet when that run was made have their default; those that are gone are passed over.
    """
    for group in ("experiment", "preset"):
        if group in chosen:
            raise InputError(f"{group}= starts a new run; on an earlier one set single values instead")
    leaves = dict(_leaves(read_saved(earlier)))
    for old, new in RENAMED.items():
        if any(name == old or name.startswith(old + ".") for name in leaves):
            raise InputError(f"{earlier} is of an earlier version: {old} is now {new}; rename it there")
    leaves = {name: value for name, value in leaves.items() if why_gone(name) is None}
    if not leaves or not {key.name for key in leaf_keys()}.issuperset(leaves):
        raise no_configuration(earlier)
    result = deepcopy(tree)
    for name, value in leaves.items():
        _check_plain(earlier, name, value)
        _put(result, name, value)
    for key in (key.replace("/", ".") for key in chosen):
        if key not in path_keys():  # theirs come last of all
            _put(result, key, _at(tree, key))
    return result


def _check_plain(earlier: Path, name: str, value: Any) -> None:
    """Saved settings hold no interpolation: none would be resolved, but whoever wrote it wants it to be."""
    if isinstance(value, list | dict):
        for one in value.values() if isinstance(value, dict) else value:
            _check_plain(earlier, name, one)
    elif isinstance(value, str) and "\0" in value:
        raise InputError(f"{earlier}: {name} is {value}, which no file and no setting can be called; write another")
    elif isinstance(value, str) and "${" in value and not (name in path_keys() and Path(value).is_absolute()):
        raise InputError(f"{earlier}: {name} is {value}, but saved settings hold plain values; write the value itself")


def _at(tree: Any, key: str) -> Any:
    for name in key.split("."):
        tree = tree.get(name, NOT_GIVEN) if isinstance(tree, dict) else NOT_GIVEN
    return tree


def _put(tree: Tree, key: str, value: Any) -> None:
    *parents, last = key.split(".")
    for name in parents:
        if not isinstance(tree.get(name), dict):
            tree[name] = {}
        tree = tree[name]
    tree[last] = value


def _leaves(tree: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted names and values of all that are no groups."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from _leaves(value, f"{prefix}.{key}" if prefix else str(key))
    else:
        yield prefix, tree


def _check_given(values: Tree, later: list[str]) -> None:
    """Refuse what has to be given and is not, here or `later`."""
    missing = next((name for name, value in _leaves(values) if value == NOT_GIVEN and name not in later), None)
    if missing is not None:
        raise InputError(sentences.not_given(missing))


def _given(tree: Any) -> Any:
    """Without what still has to be given."""
    if isinstance(tree, dict):
        return {key: _given(value) for key, value in tree.items() if value != NOT_GIVEN}
    return [_given(value) for value in tree] if isinstance(tree, list) else tree
