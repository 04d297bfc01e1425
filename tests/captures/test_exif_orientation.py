"""Photos are turned as their EXIF says where their intrinsics are for the turned ones, and nowhere else."""

from __future__ import annotations

import json
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageOps

from room2dgs.captures.photos import PhotoBytes
from room2dgs.captures.read import read_scene
from room2dgs.captures.turned_photo import TurnedPhoto
from room2dgs.errors import InputError

TAG = 0x0112
BACK = {
    1: None,
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    6: Image.Transpose.ROTATE_90,
    8: Image.Transpose.ROTATE_270,
}


def tagged(image: Image.Image, orientation: int, stored_turned: bool = True) -> Image.Image:
    """A picture as a camera stores it that was held otherwise."""
    image = image.convert("RGB")
    if stored_turned and BACK[orientation] is not None:
        image = image.transpose(BACK[orientation])
    exif = Image.Exif()
    exif[TAG] = orientation
    image.info["exif"] = exif.tobytes()
    return image


def rewrite(root, orientation: int, stored_turned: bool = True) -> None:
    for path in sorted((root / "images").rglob("*.png")):
        image = tagged(Image.open(path), orientation, stored_turned)
        image.save(path, exif=image.info["exif"])


@pytest.mark.parametrize("orientation", [6, 8])
def test_photos_stored_on_their_side_are_turned_as_their_cameras_are(written, settings, made, orientation):
    root = written("nerfstudio")
    rewrite(root, orientation)
    scene = read_scene(settings(root))
    for frame, photo in zip(scene.frames, made.photos, strict=True):
        np.testing.assert_array_equal(frame.color()[..., ::-1], photo)
        np.testing.assert_allclose(frame.camera.K, made.K, atol=1e-9)
        assert frame.full_size() == (96, 72)
    assert any("6 photos are turned as their EXIF says" in note for note in scene.notes)
    assert len({frame.digest() for frame in scene.frames}) == 6


@pytest.mark.parametrize("orientation", [3, 6])
def test_photos_whose_intrinsics_fit_as_they_are_stored_are_not_turned(written, settings, made, orientation):
    """COLMAP looks at pixels alone."""
    root = written("nerfstudio")
    rewrite(root, orientation, stored_turned=False)
    scene = read_scene(settings(root))
    np.testing.assert_array_equal(scene.frames[0].color()[..., ::-1], made.photos[0])
    assert any("6 photos have an EXIF orientation that is not applied" in note for note in scene.notes)
    assert not scene.warnings


def test_square_photos_and_intrinsics_without_a_size_are_a_warning(written, settings, made):
    square = replace(made, photos=made.photos[:, :, :72], depths=made.depths[:, :, :72], size=(72, 72))
    root = written("nerfstudio", made=square)
    rewrite(root, 6, stored_turned=False)
    scene = read_scene(settings(root))
    np.testing.assert_array_equal(scene.frames[0].color()[..., ::-1], square.photos[0])
    assert any("nothing tells" in line for line in scene.warnings)
    given_K = read_scene(settings(root, intrinsics=[81.0, 84.0, 36.0, 36.0]))
    assert any("nothing tells" in line for line in given_K.warnings)


def test_masks_made_of_the_turned_photos_fit_and_those_of_the_stored_ones_are_named(written, settings, made):
    root = written("nerfstudio")
    rewrite(root, 6)
    known = json.loads((root / "transforms.json").read_text())
    (root / "masks").mkdir()
    white = np.full((72, 96), 255, np.uint8)
    white[:, :24] = 0
    for frame in known["frames"]:
        frame["mask_path"] = "masks/all.png"
    (root / "transforms.json").write_text(json.dumps(known))
    Image.fromarray(white).save(root / "masks/all.png")
    mask = read_scene(settings(root)).frames[0].mask()
    assert not mask[:, :24].any() and mask[:, 24:].all()
    Image.fromarray(white.T).save(root / "masks/all.png")
    with pytest.raises(InputError, match=r"lies on its side.*turn the masks"):
        read_scene(settings(root))


def test_a_refusal_names_the_orientation(written, settings, made):
    root = written("scannet")
    for path in sorted((root / "color").iterdir()):
        image = tagged(Image.open(path), 6)
        image.save(path, exif=image.info["exif"], quality=95)
    for path in root.rglob("intrinsic_depth.txt"):
        path.unlink()
    with pytest.raises(InputError, match="EXIF"):
        read_scene(settings(root))


@given(st.integers(1, 8), st.integers(2, 9), st.integers(2, 9))
def test_a_turned_photo_is_what_viewers_show(orientation, width, height):
    pixels = np.random.default_rng(width * height).integers(0, 255, (height, width, 3), np.uint8)
    exif = Image.Exif()
    exif[TAG] = orientation
    file = BytesIO()
    Image.fromarray(pixels).save(file, "PNG", exif=exif)
    photo = TurnedPhoto(PhotoBytes("a photo", file.getvalue), orientation)
    shown = np.array(ImageOps.exif_transpose(Image.open(file)))
    np.testing.assert_array_equal(photo.pixels(), shown)
    assert photo.size() == shown.shape[1::-1]
