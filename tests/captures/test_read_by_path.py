"""A capture is read by its path alone."""

from __future__ import annotations

import os
import re

import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.errors import InputError


@pytest.mark.parametrize("kind", [str, os.fspath, lambda path: path])
def test_a_path_is_read_with_the_default_settings(wall, kind):
    by_path = read_scene(kind(wall))
    by_settings = read_scene(load_config([f"scene.path={wall}", "out=unused"]).scene)
    assert [frame.name for frame in by_path.frames] == [frame.name for frame in by_settings.frames]
    for one, other in zip(by_path.frames, by_settings.frames, strict=True):
        assert np.array_equal(one.camera.cam_from_world, other.camera.cam_from_world)
        assert one.digest() == other.digest()


@pytest.mark.parametrize("other", [None, 3, ["room"], load_config(["scene.path=x", "out=y"])])
def test_what_is_neither_path_nor_settings_is_one_sentence(other):
    with pytest.raises(InputError, match=re.escape("is no capture; give its path, or settings")) as error:
        read_scene(other)
    assert "\n" not in str(error.value)


def test_a_path_that_is_not_there_has_the_sentence_of_the_command():
    with pytest.raises(InputError, match="nowhere is not there"):
        read_scene("nowhere")
