"""Hydra's `compose`, also while another Hydra application is running in this process."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from hydra import compose, initialize_config_dir
from hydra import version as hydra_version
from hydra.core.global_hydra import GlobalHydra
from hydra.core.singleton import Singleton
from omegaconf import DictConfig


def conf_dir() -> Path:
    """The folder of the Hydra groups, in a checkout and in an installed wheel alike."""
    inside = Path(__file__).parents[1] / "conf"
    return inside if inside.is_dir() else Path(__file__).parents[2] / "conf"


def composed(overrides: Sequence[str]) -> DictConfig:
    """conf/config.yaml with its groups and the overrides, as Hydra puts them together; not validated.

    Raises:
        HydraException: the overrides cannot be read, or name what is not there.
    """
    with hydra_to_itself(), initialize_config_dir(str(conf_dir().resolve()), version_base="1.3"):
        return compose("config", overrides=list(overrides))


@contextmanager
def hydra_to_itself() -> Iterator[None]:
    """Hydra keeps its state in singletons: what an application around us has there is put aside, then put back."""
    before = {kind: Singleton._instances.pop(kind) for kind in _OURS if kind in Singleton._instances}
    try:
        yield
    finally:
        for kind in _OURS:
            Singleton._instances.pop(kind, None)
        Singleton._instances.update(before)


_OURS = (GlobalHydra, hydra_version.VersionBase)
