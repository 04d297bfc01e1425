"""Where things lie is no setting that decides a result; what lies there is."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.config import Config, load_config
from room2dgs.errors import InputError
from room2dgs.runs.folder import earlier_run, new_run, write_config
from room2dgs.train.fingerprint import PHOTOS, POINTS_FILE, check_same, fingerprint


def of(capture: Path, *more: str) -> dict:
    config = load_config([f"scene.path={capture}", "out=any", *more])
    return fingerprint(config, read_scene(config.scene))


@pytest.fixture
def copy(wall, tmp_path) -> Path:
    return Path(shutil.copytree(wall, tmp_path / "copy"))


def with_points(capture: Path) -> list[str]:
    return ["points.source=file", f"points.file={capture / 'points.ply'}"]


def test_the_same_capture_elsewhere_and_another_cache_are_the_same_run(wall, copy):
    before = of(wall, *with_points(wall))
    check_same(before, of(copy, *with_points(copy), f"points.cache={copy}"), copy)
    cached = of(wall, "points.cache=/somewhere")
    check_same(cached, of(copy), copy)


def test_a_run_of_before_photos_were_noted_knows_its_capture_by_the_path(wall, copy):
    before = of(wall)
    before = {key: value for key, value in before.items() if key not in (PHOTOS, POINTS_FILE)}
    check_same(before | {"points.cache": "/any"}, of(wall), copy)
    with pytest.raises(InputError, match=r"trained with scene\.path="):
        check_same(before, of(copy), copy)


def test_other_photos_at_the_same_poses_and_other_points_are_another_run(wall, copy):
    before = of(wall, *with_points(wall))
    path = copy / "points.ply"
    path.write_bytes(path.read_bytes()[:-1] + b"\x07")
    with pytest.raises(InputError, match="trained with other given points than there are now"):
        check_same(before, of(copy, *with_points(copy)), copy)
    photo = copy / "color/3.png"
    cv2.imwrite(str(photo), np.full_like(cv2.imread(str(photo)), 90))
    with pytest.raises(InputError, match="trained with other photos than there are now"):
        check_same(before, of(copy, *with_points(wall)), copy)


def saved(folder: Path, *more: str) -> Config:
    (folder / "capture/color").mkdir(parents=True)
    config = load_config([f"scene.path={folder / 'capture'}", f"out={folder}", *more])
    write_config(folder, config)
    return config


def test_what_lay_in_a_runs_folder_moves_along(tmp_path):
    before, now = tmp_path / "before", tmp_path / "new/now"
    saved(before, f"points.cache={before / 'cache'}", f"prior.cache={tmp_path / 'maps'}")
    shutil.move(before, now)
    for config in (earlier_run([f"run={now}"]), new_run([f"out={now}", "resume=true"])):
        assert config.out == str(now) and config.scene.path == str(now / "capture")
        assert config.points.cache == str(now / "cache")  # though nothing is in it yet
        assert config.prior.cache == str(tmp_path / "maps")
    config = earlier_run([f"run={now}", f"scene.path={tmp_path}"])
    assert config.scene.path == str(tmp_path)


def test_a_copy_without_the_capture_goes_on_with_the_one_that_is_there(tmp_path):
    before, now = tmp_path / "before", tmp_path / "now"
    saved(before)
    now.mkdir()
    shutil.copy(before / "config.yaml", now)
    assert earlier_run([f"run={now}"]).scene.path == str(before / "capture")
