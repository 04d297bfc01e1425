"""From conf/ and overrides to a validated `Config`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import yaml
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import TypeAdapter, ValidationError

from room2dgs.config import sentences
from room2dgs.config.composing import composed, conf_dir
from room2dgs.config.keys import leaf_keys
from room2dgs.config.overrides import GONE, RENAMED, checked_overrides, group_choices, override_keys
from room2dgs.config.schema import Config
from room2dgs.errors import InputError

NOT_GIVEN = "???"  # OmegaConf's mark of a value that must come from the user


def load_config(overrides: Sequence[str] = (), earlier: Path | None = None) -> Config:
    """Compose and validate.

    Args:
        overrides: Hydra overrides, e.g. ["scene.path=room", "train.iterations=100"].
        earlier: config.yaml of an earlier run; it gives every setting that no override names.

    Raises:
        InputError: unknown key, wrong type, missing or impossible value; the sentence names the key.
    """
    checked = checked_overrides(overrides, group_choices(conf_dir()))
    try:
        tree = composed(checked)
        if earlier is not None:
            tree = _on_top_of(earlier, tree, override_keys(checked))
        values = OmegaConf.to_container(tree, resolve=True)
    except (HydraException, OmegaConfBaseException) as error:
        raise InputError(sentences.of_composition(error)) from error
    try:
        return TypeAdapter(Config).validate_python(_given(values))
    except ValidationError as error:
        raise InputError(sentences.of_validation(error, overrides)) from error


def dump_config(config: Config) -> str:
    """The configuration as YAML."""
    return OmegaConf.to_yaml(OmegaConf.create(asdict(config)))


def _on_top_of(earlier: Path, tree: DictConfig, chosen: list[str]) -> DictConfig:
    """The earlier run's settings with the chosen keys (settings or whole groups) taken from `tree`.

    Settings that did not exist yet when that run was made have their default; those that are gone are passed over.
    """
    if "experiment" in chosen:
        raise InputError("experiment= starts a new run; on an earlier one set single values instead")
    try:
        raw = OmegaConf.load(earlier)
        names = list(_leaves(OmegaConf.to_container(raw, resolve=True)))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, OmegaConfBaseException) as error:
        raise _no_configuration(earlier) from error
    for old, new in RENAMED.items():
        if any(name == old or name.startswith(old + ".") for name in names):
            raise InputError(f"{earlier} is of an earlier version: {old} is now {new}; rename it there")
    for name in GONE.keys() & names:
        group, _, key = name.rpartition(".")
        del OmegaConf.select(raw, group)[key]
    if not names or not {key.name for key in leaf_keys()}.issuperset(set(names) - GONE.keys()):
        raise _no_configuration(earlier)
    result = OmegaConf.merge(tree, raw)
    for key in (key.replace("/", ".") for key in chosen):
        OmegaConf.update(result, key, OmegaConf.select(tree, key), merge=False)
    return result


def _no_configuration(path: Path) -> InputError:
    return InputError(f"{path} is not the configuration of a run; choose another out=DIR")


def _leaves(tree: Any, prefix: str = "") -> Iterator[str]:
    """Dotted names of all values that are no groups."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from _leaves(value, f"{prefix}.{key}" if prefix else str(key))
    else:
        yield prefix


def _given(tree: Any) -> Any:
    """Without what still has to be given."""
    if isinstance(tree, dict):
        return {key: _given(value) for key, value in tree.items() if value != NOT_GIVEN}
    return [_given(value) for value in tree] if isinstance(tree, list) else tree
