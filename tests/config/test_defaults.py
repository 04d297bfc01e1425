"""A default stands at its field and nowhere else; every setting is described by sentences of its own."""

from __future__ import annotations

import re
from collections import Counter

import pytest
import yaml
from omegaconf import OmegaConf

from room2dgs.config import conf_dir, load_config
from room2dgs.config.composing import composed
from room2dgs.config.defaults import NOT_GIVEN, default_tree
from room2dgs.config.keys import leaf_keys
from room2dgs.registries.losses import LOSSES
from tests.config.test_config import flat

VAGUE = r"\b(likewise|of them|of it$|and so|the same of|these)\b"
CHOICES = [
    path
    for path in sorted(conf_dir().rglob("*.yaml"))
    if path.relative_to(conf_dir()).parts[0] not in ("experiment", "preset", "config.yaml")
    and "_" not in path.parent.name[0]
]


def test_hydra_begins_with_the_defaults_of_the_fields():
    defaults = flat(default_tree())
    assert flat(OmegaConf.to_container(composed(()))) == defaults
    assert {key.name: key.default for key in leaf_keys()} == defaults
    assert {name for name, value in defaults.items() if value == NOT_GIVEN} == {"out", "scene.path"}


@pytest.mark.parametrize("path", CHOICES, ids=[path.relative_to(conf_dir()).as_posix() for path in CHOICES])
def test_a_choice_of_conf_says_what_differs_and_nothing_else(path):
    group = ".".join(path.relative_to(conf_dir()).parent.parts)
    defaults = flat(default_tree())
    given = yaml.safe_load(path.read_text()) or {}
    parents = [one for one in given.pop("defaults", []) if isinstance(one, str) and one != "_self_"]
    for name, value in flat(given).items() if given else ():
        names_the_choice = name in ("source", "name")  # so that it holds on top of another one
        assert names_the_choice or parents or defaults[f"{group}.{name}"] != value, name


def test_every_setting_has_sentences_of_its_own():
    seen = Counter(key.comment for key in leaf_keys())
    for key in leaf_keys():
        assert key.comment[0].isupper() and key.comment.endswith("."), key
        assert len(key.comment.split()) >= 4 and seen[key.comment] == 1, key
        assert "{" not in key.comment and not re.search(VAGUE, key.comment), key


def test_the_terms_of_the_loss_are_named_in_their_sentences():
    comments = {key.name: key.comment for key in leaf_keys()}
    terms = [name for name in LOSSES.names() if name != "rgb"]
    assert comments["loss.depth_prior.weight"] == "Weight of the depth prior term."
    assert len({comments[f"loss.{term}.enabled"] for term in terms}) == len(terms)


def test_about_sixty_settings_are_public():
    public = [key.name for key in leaf_keys() if key.public]
    assert 55 <= len(public) <= 65, len(public)
    assert {"out", "scene.path", "scene.image_width", "train.iterations", "mesh.voxel_m", "render.device"} <= set(
        public
    )


def test_a_list_is_a_new_one_for_every_configuration():
    one, other = (load_config(["scene.path=a", "out=b"]) for _ in range(2))
    one.train.resolutions.clear()
    one.eval.protocols.append("neuris")
    assert other.eval.protocols == ["area"] and len(other.train.resolutions) == 1
    assert load_config(["scene.path=a", "out=b"]) == other
