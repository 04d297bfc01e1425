"""A path that is no capture: the sentence says what it is, and which path near to it is one."""

from __future__ import annotations

import os
import shutil
import unicodedata
import zipfile

import pytest

from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError


@pytest.fixture
def said(settings):
    def sentence(path) -> str:
        with pytest.raises(InputError) as caught:
            read_scene(settings(path))
        assert "\n" not in str(caught.value)
        return str(caught.value)

    return sentence


@pytest.mark.parametrize("name", ["scannet", "nerfstudio", "colmap", "sens", "record3d_archive", "polycam_zip"])
def test_the_folder_above_a_capture_names_it(written, said, tmp_path, name):
    (tmp_path / "all").mkdir()
    root = written(name).rename(tmp_path / "all/room")
    (root.parent / "notes.txt").write_text("my room")
    found = said(root.parent)
    assert f"scene.path={root} is a capture" in found and "prepare" not in found


def test_two_folders_above_a_capture_and_several_captures(written, said, tmp_path):
    first = written("scannet")
    (tmp_path / "all/day one").mkdir(parents=True)
    first.rename(tmp_path / "all/day one/room")
    assert f"scene.path={tmp_path}/all/day one/room is a capture" in said(tmp_path)
    written("replica").rename(tmp_path / "all/day one/cellar")
    found = said(tmp_path / "all")
    assert "2 captures are in it (day one/cellar, day one/room)" in found
    assert f"scene.path={tmp_path}/all/day one/cellar" in found


@pytest.mark.parametrize("name", ["nerfstudio", "colmap", "tum"])
def test_photos_and_texts_beside_captures_do_not_hide_them(written, said, tmp_path, name):
    (tmp_path / "all").mkdir()
    root = written(name).rename(tmp_path / "all/room")
    (root.parent / "README.md").write_text("my rooms")
    (root.parent / "door.jpg").write_bytes(b"\xff\xd8\xff\xd9")
    assert f"scene.path={root} is a capture ({name})" in said(root.parent)


@pytest.mark.parametrize(("name", "part"), [("scannet", "color"), ("scannet", "color/0.jpg"), ("stray", "rgb.mp4")])
def test_a_part_of_a_capture_names_the_whole(written, said, name, part):
    root = written(name)
    found = said(root / part)
    assert f"scene.path={root} ({name})" in found and "prepare" not in found


def test_photos_alone_are_still_to_be_prepared(written, said, tmp_path):
    (written("scannet") / "color").rename(tmp_path / "photos")
    shutil.rmtree(tmp_path / "scannet")
    assert "room2dgs prepare images=DIR" in said(tmp_path / "photos")


def test_an_empty_folder_and_files_that_are_no_captures(said, tmp_path):
    (tmp_path / "room").mkdir()
    assert "room is empty; give scene.path=DIR" in said(tmp_path / "room")
    (tmp_path / "room/mesh.ply").write_text("ply\n")
    assert "mesh.ply is a file that is no capture" in said(tmp_path / "room/mesh.ply")
    with zipfile.ZipFile(tmp_path / "room/all.zip", "w") as archive:
        archive.writestr("transforms.json", "{}")
    found = said(tmp_path / "room/all.zip")
    assert "is an archive of no layout" in found and "unpack it" in found


def test_a_path_in_other_letters_names_the_right_one(written, said, tmp_path):
    root = written("scannet")
    assert f"give scene.path={root}" in said(tmp_path / "ScanNet")
    assert "upper and lower case" in said(tmp_path / "ScanNet")
    (tmp_path / unicodedata.normalize("NFD", "Büro")).mkdir()
    found = said(tmp_path / unicodedata.normalize("NFC", "Büro") / "room")
    assert "another Unicode form" in found and "room" in found


def test_links_and_what_is_no_file(said, tmp_path):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "dead").symlink_to(tmp_path / "gone")
    os.mkfifo(tmp_path / "pipe.sens")
    assert "leads back to itself" in said(tmp_path / "loop")
    assert "which is not there" in said(tmp_path / "dead")
    assert "is a pipe" in said(tmp_path / "pipe.sens")
    assert "is a device" in said("/dev/null")


@pytest.mark.parametrize("spoil", [lambda path: path.symlink_to(path), os.mkfifo, lambda path: path.mkdir()])
def test_a_sens_that_is_no_file(said, tmp_path, spoil):
    (tmp_path / "room").mkdir()
    spoil(tmp_path / "room/scene.sens")
    assert "scene.sens" in said(tmp_path / "room")


def test_a_json_without_frames_is_no_capture(tmp_path, settings):
    (tmp_path / "0.jpg").write_bytes(b"x")
    (tmp_path / "settings.json").write_text('{"fps": 30}')
    with pytest.raises(InputError, match="has photos and poses are unknown: `room2dgs prepare"):
        read_scene(settings(tmp_path))
    (tmp_path / "cameras.json").write_text('{"w": 96, "frames": []}')
    with pytest.raises(InputError, match=r"cameras\.json is a capture \(nerfstudio\)"):
        read_scene(settings(tmp_path))
