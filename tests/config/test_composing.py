"""`composed` keeps what groups come to: with it or without, a tree and an error are Hydra's own."""

from __future__ import annotations

import pytest
from hydra.core.config_store import ConfigStore
from hydra.errors import HydraException
from omegaconf import OmegaConf

from room2dgs.config import composing
from room2dgs.config.composing import composed, conf_dir
from room2dgs.config.defaults import STORED


def by_hydra(*overrides: str) -> dict:
    return OmegaConf.to_container(composing._by_hydra(conf_dir().resolve(), overrides))


@pytest.mark.parametrize(
    "overrides",
    [
        ("train.iterations=5", "experiment=quick", "scene.image_width=64"),  # a value has the last word, wherever it is
        ("eval.protocols=[area,neuris]", "scene.path='a, b'", "out=${scene.path}", "mesh.max_depth_m=null"),
        ("prior/depth=sensor", "prior=none"),
        ("loss.multiview_photometric={start:0.5}",),
    ],
)
def test_a_tree_is_hydras(overrides):
    assert OmegaConf.to_container(composed(overrides)) == by_hydra(*overrides)


@pytest.mark.parametrize("override", ["train.iterations=1,2", "prior.depth={a:1}", "prior.depth=[1,2]", "out='a"])
def test_an_error_is_hydras(override):
    with pytest.raises(HydraException) as theirs:
        by_hydra(override)
    with pytest.raises(type(theirs.value)) as ours:
        composed([override])
    assert str(ours.value) == str(theirs.value)


def test_no_value_stays_for_the_next_call():
    before = composed(["experiment=quick"])
    changed = composed(["experiment=quick", "train.iterations=7", "eval.protocols=[neuris]"])
    changed.scene.path = "another"
    assert composed(["experiment=quick"]) == before != changed


def test_defaults_are_there_when_another_application_has_put_back_a_store_without_them(monkeypatch):
    store = ConfigStore.instance()
    monkeypatch.setattr(store, "repo", {name: node for name, node in store.repo.items() if not name.startswith(STORED)})
    assert OmegaConf.to_container(composing._by_hydra(conf_dir().resolve(), []))["train"]["iterations"] == 3000
