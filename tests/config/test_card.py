"""Cards of networks: which one is read, what it may say, and what it gives the settings."""

from __future__ import annotations

import json

import pytest

from room2dgs.config import conf_dir, dump_config, load_config
from room2dgs.config.card import FOLDER, card_names, card_of, read_card
from room2dgs.config.overrides import group_choices
from room2dgs.errors import InputError

GIVEN = ["scene.path=a", "out=b", "prior=none"]
CARD = {"card": 1, "depth": {"meaning": "relative_depth"}, "normal": {"axes": "opengl", "facing": "away"}}


@pytest.fixture
def model(tmp_path):
    """A model with its card beside it."""
    (tmp_path / "net.json").write_text(json.dumps(CARD))
    return tmp_path / "net.onnx"


def test_a_card_beside_the_model_says_what_its_maps_mean(model):
    both = ["prior/depth=onnx", f"prior.depth.model={model}", "prior/normal=onnx", f"prior.normal.model={model}"]
    prior = load_config([*GIVEN, *both]).prior
    assert (prior.depth.meaning, prior.normal.axes, prior.normal.facing) == ("relative_depth", "opengl", "away")
    # what is given has the last word
    prior = load_config([*GIVEN, *both, "prior.depth.meaning=metric_depth", "prior.normal.axes=rdb"]).prior
    assert (prior.depth.meaning, prior.normal.axes, prior.normal.facing) == ("metric_depth", "rdb", "away")


def test_a_known_network_has_its_own_card_and_a_given_one_comes_first(model):
    prior = load_config([*GIVEN, "prior/depth=omnidata", f"prior.depth.model={model}"]).prior
    assert prior.depth.network == "omnidata_depth" and card_of(prior.depth, "depth").input.height == 384
    card = model.with_name("other.json")
    card.write_text(json.dumps({**CARD, "input": {"height": 14}}))
    prior = load_config(
        [*GIVEN, "prior/depth=omnidata", f"prior.depth.model={model}", f"prior.depth.card={card}"]
    ).prior
    assert card_of(prior.depth, "depth").input.height == 14


def test_maps_that_no_network_makes_are_metres_and_normals_of_opencv():
    prior = load_config([*GIVEN, "prior=files", "prior.depth.path=d", "prior.normal.path=n"]).prior
    assert (prior.depth.meaning, prior.normal.axes, prior.normal.facing) == ("metric_depth", "opencv", "camera")


def test_a_runs_saved_settings_need_the_card_no_more(model, tmp_path):
    config = load_config([*GIVEN, "prior/depth=onnx", f"prior.depth.model={model}"])
    (tmp_path / "config.yaml").write_text(dump_config(config))
    model.with_name("net.json").unlink()
    assert load_config(["mesh.voxel_m=0.03"], tmp_path / "config.yaml").prior == config.prior
    with pytest.raises(InputError, match=r"net\.onnx has no card: write .*net\.json beside it"):
        card_of(config.prior.depth, "depth")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "is no JSON"),
        ("[1]", 'does not begin with "card": 1'),
        ('{"depth": {}}', 'does not begin with "card": 1'),
        ('{"card": 2, "depth": {"meaning": "metric_depth"}}', "card is 2 and should be 1"),
        ('{"card": 1}', "it has neither depth nor normal"),
        ('{"card": 1, "depth": {}}', "depth.meaning is missing"),
        ('{"card": 1, "depth": {"meaning": "metres"}}', "depth.meaning is 'metres' and should be 'metric_depth', "),
        ('{"card": 1, "normal": {}, "input": {"heigth": 3}}', "input.heigth is no key of a card"),
        (
            '{"card": 1, "normal": {}, "input": {"fit": "crop"}}',
            "input.fit is 'crop' and should be 'stretch', 'pad' or",
        ),
        ('{"card": 1, "normal": {}, "input": {"std": [1, 1, 0]}}', "input.std.2 is 0 and should be greater than"),
        ('{"card": 1, "normal": {}, "input": {"mean": [0]}}', "input.mean.1 is missing"),
        ('{"card": 1, "normal": {}, "sha256": "abc"}', "sha256 is 'abc' and String should match pattern"),
        ('{"card": 1, "normal": {}, "input": {"white": NaN}}', "input.white is nan and"),
    ],
)
def test_a_card_that_cannot_be_used_is_one_sentence_that_names_the_key(tmp_path, text, said):
    path = tmp_path / "net.json"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        read_card(path)
    assert str(path) in str(refused.value) and said in str(refused.value) and "\n" not in str(refused.value)


def test_a_card_without_the_map_that_is_wanted_is_told(model):
    with pytest.raises(
        InputError, match=r"dsine\.json is the card of a network without depth; choose another prior/depth"
    ):
        load_config([*GIVEN, "prior/depth=onnx", f"prior.depth.model={model}", "prior.depth.network=dsine"])


def test_every_card_that_comes_with_the_package_is_read_and_chosen_by_a_name():
    assert {"room_prior", "moge_2", "depth_anything_v2"} <= set(card_names())
    chosen = set()
    for kind in ("depth", "normal"):
        for name in set(group_choices(conf_dir())[f"prior/{kind}"]) - {"onnx", "onnx_multiview"}:
            given = [f"prior/{kind}={name}", f"prior.{kind}.model=m.onnx", f"prior.{kind}.path=p"]
            part = getattr(load_config([*GIVEN, *given]).prior, kind)
            if part.network:
                chosen.add(part.network)
                assert getattr(card_of(part, kind), kind) is not None
    assert chosen == set(card_names())
    for name in card_names():
        card = read_card(conf_dir() / FOLDER / f"{name}.json")
        assert card.about.endswith(".") and card.get and card.licence.endswith(".")
