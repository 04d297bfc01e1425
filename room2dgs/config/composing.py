"""Hydra's `compose`, also while another Hydra application is running in this process."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra import version as hydra_version
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import OverrideType
from hydra.core.singleton import Singleton
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from room2dgs.config.defaults import store_defaults
from room2dgs.config.folder import conf_dir


def composed(overrides: Sequence[str]) -> DictConfig:
    """The defaults, changed by conf/config.yaml with its choices and the overrides, as Hydra puts them together.

    Nothing is validated here.

    Hydra takes a third of a second to put the groups together: what it came to is kept for the next call with them.

    Args:
        overrides: "KEY=VALUE" each, of known keys.

    Raises:
        HydraException: the overrides cannot be read, or name what is not there.
    """
    folder = conf_dir().resolve()
    choices: list[str] = []
    values: list[str] = []
    for text in overrides:
        is_choice = (folder / text.partition("=")[0]).is_dir()  # a group is a folder
        (choices if is_choice else values).append(text)
    parsed = OverridesParser.create().parse_overrides(values)
    if all(one.type == OverrideType.CHANGE and not one.is_sweep_override() and not one.package for one in parsed):
        tree = copy.deepcopy(_with_choices(folder, tuple(choices)))
        with suppress(OmegaConfBaseException):
            for one in parsed:
                OmegaConf.update(tree, one.key_or_group, one.value(), merge=True)
            return tree
    return _by_hydra(folder, overrides)  # sweeps, +KEY and what does not fit: its word, or its error


@lru_cache(maxsize=32)
def _with_choices(folder: Path, choices: tuple[str, ...]) -> DictConfig:
    return _by_hydra(folder, choices)


def _by_hydra(folder: Path, overrides: Sequence[str]) -> DictConfig:
    with hydra_to_itself(), initialize_config_dir(str(folder), version_base="1.3"):
        return compose("config", overrides=list(overrides))


@contextmanager
def hydra_to_itself() -> Iterator[None]:
    """Hydra keeps its state in singletons: what an application around us has there is put aside, then put back."""
    store_defaults()  # whose store may have been replaced
    before: dict[type, Any] = {kind: Singleton._instances.pop(kind) for kind in _OURS if kind in Singleton._instances}
    try:
        yield
    finally:
        for kind in _OURS:
            Singleton._instances.pop(kind, None)
        Singleton._instances.update(before)


_OURS = (GlobalHydra, hydra_version.VersionBase)
store_defaults()  # for who composes conf/ without us
