"""Principal points off the middle: cropped photos are read, intrinsics of another size are not."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from room2dgs.captures.lens import Lens
from room2dgs.captures.principal_point import check_principal_point
from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError


def test_photos_whose_lower_third_was_cropped_are_read(written, settings, made):
    root = written("colmap")
    for path in sorted((root / "images").rglob("*.jpg")):
        cv2.imwrite(str(path), cv2.imread(str(path))[:48])
    model = root / "sparse/0/cameras.txt"
    model.write_text(model.read_text().replace("PINHOLE 96 72", "PINHOLE 96 48"))
    scene = read_scene(settings(root))
    assert len(scene.frames) == 6 and scene.frames[0].camera.size == (96, 48)
    np.testing.assert_allclose(scene.frames[0].camera.K, made.K)
    assert any("(46.5, 37.25) of 96x48" in line and "cropped" in line for line in scene.warnings)
    given_K = read_scene(settings(root, intrinsics=[81.0, 84.0, 46.5, 37.25]))
    np.testing.assert_allclose(given_K.frames[0].camera.K, made.K)


def test_whole_photos_are_no_warning(written, settings):
    assert not read_scene(settings(written("colmap"))).warnings


def test_intrinsics_of_another_size_are_refused_where_nothing_tells_their_size(written, settings, made):
    root = written("scannet")
    for name in ("intrinsic_color.txt", "intrinsic_depth.txt"):
        K = np.eye(4)
        K[:2, :3] = 2 * made.K[:2]
        np.savetxt(root / "intrinsic" / name, K)
    with pytest.raises(InputError, match=r"look like those of 1\d\dx1\d\d pixels: give scene\.intrinsics="):
        read_scene(settings(root))


def test_a_transforms_json_that_tells_no_size_is_not_trusted_with_one(written, settings):
    root = written("instant_ngp")
    known = json.loads((root / "transforms.json").read_text())
    for frame in known["frames"]:
        frame |= {"fl_x": 162.0, "fl_y": 168.0, "cx": 93.0, "cy": 74.5}
    (root / "transforms.json").write_text(json.dumps(known))
    with pytest.raises(InputError, match=r"look like those of 186x149 pixels: give scene\.intrinsics=") as caught:
        read_scene(settings(root))
    named = [float(value) for value in str(caught.value).split("=[")[1].split("]")[0].split(",")]
    np.testing.assert_allclose(named, [81.0, 84.0, 46.5, 37.25], rtol=0.01)  # photos are resized by one factor


def test_what_cannot_be_is_refused_whoever_says_it(written, settings):
    with pytest.raises(InputError, match=r"principal point at \(300, 36\), which does not fit the photos of 96x72"):
        read_scene(settings(written("colmap"), intrinsics=[81.0, 84.0, 300.0, 36.0]))
    root = written("nerfstudio")
    known = json.loads((root / "transforms.json").read_text())
    known["cy"] = -50.0
    (root / "transforms.json").write_text(json.dumps(known))
    with pytest.raises(InputError, match="does not fit the photos"):
        read_scene(settings(root))


def test_given_intrinsics_that_look_like_another_size_s_are_a_warning(written, settings):
    scene = read_scene(settings(written("colmap"), intrinsics=[162.0, 168.0, 93.0, 74.5]))
    assert any("look like those of" in line for line in scene.warnings)


SIDES = st.integers(64, 4000)


@given(SIDES, SIDES, st.floats(0.3, 2.0), st.floats(0.3, 2.0))
def test_every_crop_that_holds_its_principal_point_is_read(width, height, crop_x, crop_y):
    """The left upper part of a photo, or a photo with borders added at the right and below."""
    size = max(16, round(width * crop_x)), max(16, round(height * crop_y))
    assume(width / 2 < 1.4 * size[0] and height / 2 < 1.4 * size[1])
    lens = Lens("PINHOLE", (900.0, 900.0, width / 2, height / 2), size, "a file")
    check_principal_point(lens, sure=True)


@given(SIDES, SIDES, st.one_of(st.floats(0.35, 0.68), st.floats(1.35, 1.9)))
def test_a_size_off_by_one_factor_is_refused_and_named(width, height, factor):
    K = (700.0 * factor, 705.0 * factor, width / 2 * factor, height / 2 * factor)
    lens = Lens("PINHOLE", K, (width, height), "a file")
    with pytest.raises(InputError) as caught:
        check_principal_point(lens)
    right = f"{700:g},{705:g},{width / 2:.6g},{height / 2:.6g}"
    assert right in str(caught.value)
    assert "cropped" in (check_principal_point(lens, sure=True) or "")
    assert check_principal_point(replace(lens, size=(round(width * factor), round(height * factor)))) is None
