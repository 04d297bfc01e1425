"""Videos, folders and earlier work that are cut, changed or lie: photos or one sentence."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from room2dgs.captures.read import placed
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.prepare.photos import choose_photos
from room2dgs.prepare.stage_cache import StageCache


@pytest.fixture
def video(tmp_path):
    path = tmp_path / "walk.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 5, (96, 64))
    wide = np.random.default_rng(0).integers(0, 256, (64, 400, 3)).astype(np.uint8)
    for index in range(14):
        writer.write(cv2.GaussianBlur(wide, (0, 0), 1)[:, 20 * index : 20 * index + 96])
    writer.release()
    return path


def test_a_damaged_video_gives_photos_or_a_sentence(video, tmp_path):
    whole = video.read_bytes()
    config = load_config([f"prepare.video={video}", "scene.path=unused", "out=unused"]).prepare
    found = []

    @settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(st.floats(0, 1), st.sampled_from(["cut", "zeroed", "changed"]), st.binary(min_size=1, max_size=8))
    def take(where: float, kind: str, word: bytes) -> None:
        place = int(where * len(whole))
        tail = {"cut": b"", "zeroed": bytes(64) + whole[place + 64 :], "changed": word + whole[place + len(word) :]}
        video.write_bytes(whole[:place] + tail[kind])
        out = tmp_path / f"out{len(found)}"
        found.append(out)
        try:
            photos, _ = choose_photos(config, out / "images", StageCache(out), lambda line: None)
            assert len(photos) >= 5 and all((out / "images" / photo.name).is_file() for photo in photos)
        except InputError as error:
            assert "\n" not in str(error) and not (out / "images").exists()

    take()


def test_earlier_work_that_is_damaged_is_done_again(video, tmp_path):
    config = load_config([f"prepare.video={video}", "scene.path=unused", "out=unused"]).prepare
    said: list[str] = []
    first, key = choose_photos(config, tmp_path / "images", StageCache(tmp_path), said.append)
    again, same = choose_photos(config, tmp_path / "images", StageCache(tmp_path), said.append)
    assert (again, same) == (first, key) and "from before" in said[-1]
    for text in ("", "[1, 2]", '{"key": 3}', json.dumps({"key": key, "result": 7})):
        (tmp_path / "photos.json").write_text(text)
        assert choose_photos(config, tmp_path / "images", StageCache(tmp_path), said.append) == (first, key)
        assert "from before" not in said[-1]
    (tmp_path / "images" / first[3].name).unlink()
    assert choose_photos(config, tmp_path / "images", StageCache(tmp_path), said.append) == (first, key)
    assert (tmp_path / "images" / first[3].name).is_file()


@pytest.mark.parametrize("text", ["", "{", "[]", "7", '{"metric": true}', '{"metric": "yes", "scale": []}'])
def test_a_verdict_that_is_no_verdict_makes_nothing_metric(colmap_project, text):
    (colmap_project / "prepare.json").write_text(text)
    config = load_config([f"scene.path={colmap_project}", "out=unused", "scene.test_every=0"]).scene
    try:
        assert not placed(config).metric
    except InputError as error:
        assert "prepare.json" in str(error)


def test_a_verdict_with_a_scale_makes_a_model_metric_and_depth_beside_it_known(colmap_project):
    scale = {"metres": 0.3, "source": "sensor", "sigma": 0.01}
    (colmap_project / "prepare.json").write_text(json.dumps({"metric": True, "scale": scale}))
    (colmap_project / "depth").mkdir()
    cv2.imwrite(str(colmap_project / "depth/1.png"), np.full((48, 64), 1500, np.uint16))
    scene = placed(load_config([f"scene.path={colmap_project}", "out=unused", "scene.test_every=0"]).scene)
    assert scene.metric and any("sensor, +-1%" in note for note in scene.notes)
    assert np.allclose(scene.frames[1].depth(), 1.5) and scene.frames[0].depth() is None


@pytest.fixture
def colmap_project(tmp_path):
    root = tmp_path / "project"
    (root / "sparse/0").mkdir(parents=True)
    (root / "images").mkdir()
    (root / "sparse/0/cameras.txt").write_text("1 PINHOLE 64 48 50 50 32 24\n")
    lines = []
    for index in range(5):
        cv2.imwrite(str(root / f"images/{index}.png"), np.full((48, 64, 3), 90, np.uint8))
        lines += [f"{index + 1} 1 0 0 0 {-0.1 * index} 0 0 1 {index}.png", ""]
    (root / "sparse/0/images.txt").write_text("\n".join(lines) + "\n")
    return root
