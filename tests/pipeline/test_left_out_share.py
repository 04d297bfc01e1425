"""The share of photos that a verdict calls left out."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest

from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.pipeline.verdict import left_out_share, notes_on


@pytest.mark.parametrize("frames", ["null", "4"])
def test_photos_that_are_not_asked_for_are_not_left_out(tmp_path, frames):
    from PIL import Image

    (tmp_path / "images").mkdir()
    shots = []
    for index in range(10):
        if index < 8:
            Image.new("RGB", (64, 48), (index * 20, 90, 30)).save(tmp_path / f"images/{index:02}.png")
        pose = [[1, 0, 0, 0.3 * index], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
        shots.append({"file_path": f"images/{index:02}.png", "transform_matrix": pose})
    intrinsics = {"fl_x": 50, "fl_y": 50, "cx": 32, "cy": 24, "w": 64, "h": 48}
    (tmp_path / "transforms.json").write_text(json.dumps({**intrinsics, "frames": shots}))
    config = load_config([f"scene.path={tmp_path}", "out=runs", f"scene.frames={frames}"])
    scene = read_scene(config.scene)
    assert len(scene.dropped) == 2
    assert left_out_share(scene) == pytest.approx(0.2)
    (note,) = notes_on(scene)
    assert (
        note.startswith("2 of 10 photos left out: images_08, images_09 (of the first: ") and "08.png is missing" in note
    )


def test_nothing_left_out_is_no_note(tmp_path):
    assert notes_on(SimpleNamespace(dropped=())) == ()
