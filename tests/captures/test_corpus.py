"""Each capture of the corpus is read as it should be: right, or refused in a sentence that says why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError
from room2dgs.tools.capture_layouts.registry import LAYOUTS
from tests.captures.corpus.cases import CASES, UTM, unmasked
from tests.captures.known_scene import known, wrong


@pytest.fixture
def read(settings, made, tmp_path):
    def scene(case, name: str):
        root = case.write(tmp_path / name, made)
        return read_scene(settings(root, **LAYOUTS[case.layout].settings(made)))

    return scene


@pytest.mark.parametrize("name", CASES)
def test_a_capture_is_read_as_it_should_be(read, made, name):
    case = CASES[name]
    if case.frames is None:
        with pytest.raises(InputError) as refused:
            read(case, "changed")
        assert case.says in str(refused.value) and "\n" not in str(refused.value)
        return
    scene = read(case, "changed")
    assert len(scene.frames) == case.frames
    told = scene.warnings if case.warns else (*scene.notes, *scene.warnings)
    assert any(case.says in line for line in told), told
    if not case.warns:
        assert not scene.warnings
    for frame in scene.frames:
        mask = frame.mask()
        usable = 1.0 if mask is None else float(mask.mean())
        if case.usable is not None or case.scene is unmasked:
            assert usable == pytest.approx(1.0 if case.usable is None else case.usable, abs=0.012), frame.name
    has_depth = sum(frame.depth_path is not None for frame in scene.frames)
    assert has_depth == (len(scene.frames) * LAYOUTS[case.layout].depth if case.depths is None else case.depths)
    if not case.apart:
        truth = known(read(replace(case, change=lambda root, made: None, usable=None), "whole"), made)
        if case.usable is not None:
            truth = {index: one._replace(mask=None) for index, one in truth.items()}
        assert not wrong(scene, made, truth)


def test_cropped_photos_keep_their_camera(read, made):
    for frame, pose in zip(read(CASES["colmap: photos are cropped"], "cropped").frames, made.poses, strict=True):
        assert frame.camera.size == (96, 48)
        np.testing.assert_allclose(frame.camera.K, made.K, atol=1e-9)
        np.testing.assert_allclose(frame.camera.world_from_cam, pose, atol=1e-9)


def test_depth_in_openexr_is_exact(read, made):
    frames = read(CASES["record3d: depth in OpenEXR"], "exr").frames
    for frame, depth in zip(frames, made.depths, strict=True):
        np.testing.assert_allclose(frame.depth(), depth / 1000, atol=5e-7)


def test_coordinates_of_utm_keep_their_differences(read, made):
    scene = read(CASES["scannet: coordinates of UTM"], "utm")
    for frame, pose in zip(scene.frames, made.poses, strict=True):
        world = frame.camera.centre + np.array(scene.origin_m)
        np.testing.assert_allclose(world, pose[:3, 3] + UTM, atol=1e-8)


def test_photos_of_the_same_name_have_names_of_their_own(read):
    frames = read(CASES["colmap: two folders of the same names"], "two").frames
    assert [frame.name for frame in frames] == [f"{side}_{i:04d}" for side in ("left", "right") for i in range(3)]
