"""Poses in files that are not read are called by their program's name, with what to export instead."""

from __future__ import annotations

import pytest

from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("room.psx", "<document/>", "a project of Metashape, which is not read: export its cameras as .xml"),
        ("room.rcproj", "x", "a project of RealityCapture"),
        ("cameras.csv", "#name,x,y,alt,heading,pitch,roll,f\n", "RealityCapture's poses"),
        ("images/0.xmp", '<rdf:Description xcr:Version="3"/>', "RealityCapture's poses"),
        (
            "bundle.out",
            "# Bundle file v0.3\n",
            "Bundler's poses, which is not read: export the cameras as a COLMAP model",
        ),
        ("poses_bounds.npy", "x", "LLFF's poses"),
        ("trajectory.json", '{"class_name": "PinholeCameraTrajectory"}', "Open3D's poses"),
        ("cameras.json", '[{"img_name": "0"}]', "3D Gaussian Splatting's cameras"),
        ("reconstruction.json", "[]", "OpenSfM's poses"),
        ("database.db", "SQLite format 3", "COLMAP's features without a model, which is not read: run the mapping"),
        ("groundtruth.txt", "0 0 0 0 0 0 0 1\n", "TUM's poses, which is not read: put rgb.txt"),
    ],
)
def test_poses_of_other_programs(tmp_path, settings, name, content, said):
    (tmp_path / "images").mkdir()
    (tmp_path / "images/0.jpg").write_bytes(b"x")
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError) as caught:
        read_scene(settings(tmp_path))
    assert f"{tmp_path} has {name}, {said}" in str(caught.value)
    assert "poses are unknown" not in str(caught.value)


@pytest.mark.parametrize(("name", "content"), [("0.xmp", "<x:xmpmeta/>"), ("list.csv", "photo,date\n")])
def test_files_of_the_same_kinds_without_poses(tmp_path, settings, name, content):
    (tmp_path / "0.jpg").write_bytes(b"x")
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match="has photos and poses are unknown"):
        read_scene(settings(tmp_path))
