"""From conf/ and overrides to a checked `Config`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from hydra import compose, initialize_config_dir
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from room2dgs.config.checks import check
from room2dgs.config.keys import Key, leaf_keys
from room2dgs.config.overrides import RENAMED, checked_overrides, group_choices, override_keys
from room2dgs.config.schema import Config
from room2dgs.errors import InputError


def conf_dir() -> Path:
    """The folder of the Hydra groups, in a checkout and in an installed wheel alike."""
    inside = Path(__file__).parents[1] / "conf"
    return inside if inside.is_dir() else Path(__file__).parents[2] / "conf"


def load_config(overrides: list[str] | tuple[str, ...] = (), earlier: Path | None = None) -> Config:
    """Compose, type-check and validate.

    Args:
        overrides: Hydra overrides, e.g. ["scene.path=room", "train.iterations=100"].
        earlier: config.yaml of an earlier run; it gives every setting that no override names.

    Raises:
        InputError: unknown key, wrong type, missing or impossible value; the sentence names the key.
    """
    groups = group_choices(conf_dir())
    keys = leaf_keys(Config)
    overrides = checked_overrides(overrides, [key.name for key in keys], groups)
    try:
        with initialize_config_dir(str(conf_dir().resolve()), version_base="1.3"):
            composed = compose("config", overrides=overrides)
        raw = composed if earlier is None else _on_top_of(earlier, composed, override_keys(overrides))
        merged = OmegaConf.merge(OmegaConf.structured(Config), raw)
        for name in sorted(OmegaConf.missing_keys(merged)):
            raise InputError(f"{name} is not given; add {name}={'DIR' if name in ('out', 'scene.path') else '...'}")
        config: Any = OmegaConf.to_object(merged)
    except (HydraException, OmegaConfBaseException) as error:
        raise InputError(_one_sentence(error, keys, overrides)) from error
    check(config)
    return config


def dump_config(config: Config) -> str:
    """The configuration as YAML."""
    return OmegaConf.to_yaml(OmegaConf.structured(config))


def _on_top_of(earlier: Path, composed: DictConfig, chosen: list[str]) -> DictConfig:
    """The earlier run's settings with the chosen keys (settings or whole groups) taken from `composed`.

    Settings that did not exist yet when that run was made have their default.
    """
    if "experiment" in chosen:
        raise InputError("experiment= starts a new run; on an earlier one set single values instead")
    try:
        raw = OmegaConf.load(earlier)
        for old, new in RENAMED.items():
            if OmegaConf.select(raw, old) is not None:
                raise InputError(f"{earlier} is of an earlier version: {old} is now {new}; rename it there")
        OmegaConf.merge(OmegaConf.structured(Config), raw)
    except (OSError, UnicodeDecodeError, yaml.YAMLError, OmegaConfBaseException) as error:
        raise InputError(f"{earlier} is not the configuration of a run; choose another out=DIR") from error
    raw = OmegaConf.merge(composed, raw)
    for key in (key.replace("/", ".") for key in chosen):
        OmegaConf.update(raw, key, OmegaConf.select(composed, key), merge=False)
    return raw


def _one_sentence(error: Exception, keys: list[Key], overrides: list[str]) -> str:
    """Hydra's and OmegaConf's many lines as one sentence that names the setting."""
    lines = [line.strip() for line in str(error.__cause__ or error).splitlines() if line.strip()]
    full_key = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("full_key:")), "")
    key = next((key for key in keys if key.name == full_key.partition("[")[0]), None)
    text = next((text for text in reversed(overrides) if key and text.startswith(key.name + "=")), None)
    if key and text:
        return f"{text} does not fit; {key.name} wants {key.wants}"
    return f"configuration: {lines[0]}" + (f" ({full_key})" if full_key else "")
