"""Keyword arguments as the settings that they stand for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.pipeline.settings import overrides_of

GIVEN = {"scene.path": "x", "out": "y"}


def read(**settings):
    return load_config(overrides_of({**GIVEN, **settings}))


def test_underscores_dots_and_mappings_are_the_same():
    ways = [
        {"train__rates__color": 0.5},
        {"train.rates.color": 0.5},
        {"train": {"rates": {"color": 0.5}}},
        {"train": {"rates__color": np.float32(0.5)}},
    ]
    assert len({repr(read(**way)) for way in ways}) == 1
    assert read(**ways[0]).train.rates.color == 0.5


def test_the_name_of_a_file_of_settings_is_taken_for_one():
    assert read(prior="room_prior").prior.depth.source == "room_prior"
    assert read(prior__depth="sensor").prior.depth.source == "sensor"
    assert read(mesh="unbounded", mesh__voxel_m=0.5).mesh.space == "contracted"


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("mesh.voxel_m", None),
        ("sfm.refine_poses", "auto"),
        ("sfm.refine_poses", False),
        ("export.up", "-y"),
        ("export.after_run", ["glb", "splats"]),
        ("train.resolutions", []),
        ("seeds.init", "sfm+depth"),
    ],
)
def test_values_arrive_as_they_are(key, value):
    found = read(**{key: value})
    for name in key.split("."):
        found = getattr(found, name)
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize("path", ["a=b", "a, b", "[a]", "it's", "${here}", "a\\b", " a", "ä"])
def test_any_path_arrives_as_it_is(path):
    assert read(**{"scene.path": path}).scene.path == path
    assert read(**{"scene.path": Path(path)}).scene.path == path
    assert read(eval__gt=path).eval.gt == path


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"scene__imge_width": 3}, "scene.imge_width is no setting; did you mean scene.image_width"),
        ({"mesh": 3}, "mesh=3 is not known"),
        ({"train__iterations": "320"}, "train.iterations='320' does not fit"),
        ({"train__iterations": {1, 2}}, "which no setting can be"),
    ],
)
def test_what_cannot_be_is_the_sentence_of_the_command(settings, said):
    with pytest.raises(InputError) as error:
        read(**settings)
    assert said in str(error.value)
