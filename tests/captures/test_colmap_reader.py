"""COLMAP projects: of several models, forms and folders of masks the right one, and single bad items."""

from __future__ import annotations

import json
import shutil
import struct
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from room2dgs.captures.camera_file import read_cameras
from room2dgs.captures.colmap_model import POINT, _binary_points, read_model
from room2dgs.captures.mask_files import mask_files
from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError
from room2dgs.tools.capture_layouts.colmap import colmap_binary


def first_images(path, count: int) -> None:
    """A text model of its first images alone."""
    path.write_text("\n".join(path.read_text().split("\n")[: 1 + 2 * count]) + "\n")


def test_the_model_with_most_photos_is_read_and_the_others_are_named(written, settings):
    root = written("colmap")
    for number in (1, 2, 10):
        shutil.copytree(root / "sparse/0", root / f"sparse/{number}")
    for number, count in ((0, 2), (1, 4), (10, 5)):
        first_images(root / f"sparse/{number}/images.txt", count)
    scene = read_scene(settings(root))
    assert len(scene.frames) == 6
    said = [note for note in scene.notes if note.startswith("models:")]
    assert len(said) == 1 and "sparse/2 is read" in said[0] and "0 (2), 1 (4), 10 (5)" in said[0]


def test_photos_that_are_there_count_and_not_images_that_are_named(written, settings):
    root = written("colmap")
    shutil.copytree(root / "sparse/0", root / "sparse/1")
    first_images(root / "sparse/1/images.txt", 4)
    text = root / "sparse/0/images.txt"
    for index in (7, 8, 9):
        text.write_text(text.read_text().replace(f"IMG_{index}.jpg", f"GONE_{index}.jpg"))
    scene = read_scene(settings(root))
    assert len(scene.frames) == 4 and not scene.dropped


@pytest.mark.parametrize("place", ["sparse/1", "sparse", "3", "colmap/sparse/1", "colmap/4"])
def test_a_model_is_found_whatever_its_number(written, settings, place):
    root = written("colmap")
    shutil.move(root / "sparse/0", root / "model")
    shutil.rmtree(root / "sparse")
    (root / place).parent.mkdir(parents=True, exist_ok=True)
    shutil.move(root / "model", root / place)
    assert len(read_scene(settings(root)).frames) == 6


def test_a_damaged_model_beside_a_good_one_is_named(written, settings):
    root = written("colmap")
    shutil.copytree(root / "sparse/0", root / "sparse/1")
    (root / "sparse/0/images.txt").write_text("1 2 3\n")
    scene = read_scene(settings(root))
    assert len(scene.frames) == 6 and any("cannot be read" in note for note in scene.notes)


def test_a_binary_model_and_another_as_text_are_told_apart(written, settings, made):
    root = written("colmap")
    colmap_binary(root / "other", made)
    for path in (root / "other/sparse").iterdir():
        shutil.copy(path, root / "sparse/0")
    assert not [note for note in read_scene(settings(root)).notes if "as text" in note]
    first_images(root / "sparse/0/images.txt", 4)
    scene = read_scene(settings(root))
    assert len(scene.frames) == 6
    assert any("binary model of 6 images" in note and "as text of 4" in note for note in scene.notes)


def test_few_posed_photos_are_warned_of(written, settings):
    root = written("colmap")
    for index in range(20):
        shutil.copy(root / "images/walk one/IMG_7.jpg", root / f"images/more_{index}.jpg")
    said = [line for line in read_scene(settings(root)).warnings if "poses of 6 of the 26 photos" in line]
    assert len(said) == 1


def test_few_posed_photos_beside_the_model_are_warned_of_and_other_pictures_there_do_not_count(written, settings):
    root = written("colmap")
    for photo in sorted((root / "images").iterdir()):
        photo.rename(root / photo.name)
    (root / "images").rmdir()
    assert not [line for line in read_scene(settings(root)).warnings if "has poses of" in line]
    (root / "report").mkdir()
    one = root / "walk one/IMG_7.jpg"
    for index in range(20):
        shutil.copy(one, root / f"walk one/more_{index}.jpg")
        shutil.copy(one, root / f"report/{index}.jpg")
    (root / "path.png").write_bytes(one.read_bytes())
    warnings = read_scene(settings(root)).warnings
    said = [line for line in warnings if "poses of 6 of the 26 photos" in line and "room2dgs prepare" in line]
    assert len(said) == 1


def test_two_images_of_one_name_are_refused(written, settings):
    root = written("colmap")
    text = root / "sparse/0/images.txt"
    text.write_text(text.read_text().replace("IMG_8.jpg", "IMG_7.jpg"))
    with pytest.raises(InputError, match=r"IMG_7\.jpg twice"):
        read_scene(settings(root))


def test_a_photo_in_other_letters_is_named(written, settings):
    root = written("colmap")
    (root / "images/walk one").rename(root / "images/Walk One")
    with pytest.raises(InputError, match=r"Walk One is there, which differs in upper and lower case"):
        read_scene(settings(root))


def test_cameras_without_images_are_found(written, settings):
    root = written("colmap")
    (root / "sparse/0/images.txt").unlink()
    with pytest.raises(InputError, match=r"has cameras\.txt and no images\.txt"):
        read_scene(settings(root))


def test_cropped_photos_are_read(written, settings, made):
    root = written("colmap")
    for path in (root / "images/walk one").iterdir():
        cv2.imwrite(str(path), cv2.imread(str(path))[:48])
    cameras = root / "sparse/0/cameras.txt"
    cameras.write_text(cameras.read_text().replace("PINHOLE 96 72", "PINHOLE 96 48"))
    scene = read_scene(settings(root))
    assert len(scene.frames) == 6
    assert {(frame.camera.size, float(frame.camera.K[1, 2])) for frame in scene.frames} == {((96, 48), 37.25)}


@pytest.mark.parametrize("form", ["colmap", "colmap_binary"])
def test_images_whose_rotation_is_none_cost_themselves(written, settings, made, form):
    root = written(form)
    place = root / ("sparse/0/images.txt" if form == "colmap" else "sparse/images.bin")
    if form == "colmap":
        lines = place.read_text().split("\n")
        words = lines[1].split(" ")
        lines[1] = " ".join([words[0], "0", "0", "0", "0", *words[5:]])
        place.write_text("\n".join(lines))
    else:
        data = bytearray(place.read_bytes())
        data[12:44] = bytes(32)
        place.write_bytes(data)
    scene = read_scene(settings(root))
    assert len(scene.frames) == 5 and [one.name for one in scene.dropped] == ["walk one_IMG_7"]
    assert any("images whose rotation is none" in line for line in scene.warnings)


@pytest.mark.parametrize("end", [".txt", ".bin"])
def test_cameras_that_no_image_has_cost_next_to_nothing_and_may_be_of_any_model(written, settings, end):
    root = written("colmap" if end == ".txt" else "colmap_binary")
    path = next(root.rglob(f"cameras{end}"))
    if end == ".txt":
        more = "".join(f"{index} PINHOLE 96 72 81 84 46 37\n" for index in range(10, 200_000))
        path.write_text(path.read_text() + "4 EQUIRECTANGULAR 96 72 96 72\n" + more)
    else:
        record = b"".join(struct.pack("<IiQQ4d", index, 1, 96, 72, 81, 84, 46, 37) for index in range(10, 200_000))
        other = struct.pack("<IiQQ2d", 4, 17, 96, 72, 96, 72)
        path.write_bytes(struct.pack("<Q", 199_992) + path.read_bytes()[8:] + other + record)
    start = time.process_time()
    model = read_model(path.parent)
    assert time.process_time() - start < 1.5  # 2.5 s where each was made
    assert list(model.cameras) == [3]
    assert len(read_scene(settings(root)).frames) == 6


def points_file(tracks: list[int], seed: int = 0) -> tuple[bytes, np.ndarray]:
    """points3D.bin with points of so many elements each, and the points."""
    random = np.random.default_rng(seed)
    rows = np.zeros(len(tracks), POINT)
    rows["id"] = random.integers(0, 2**60, len(tracks))
    rows["xyz"], rows["error"] = random.normal(size=(len(tracks), 3)), random.random(len(tracks))
    rows["rgb"] = random.integers(0, 256, (len(tracks), 3))
    parts = [struct.pack("<Q", len(tracks))]
    for row, count in zip(rows, tracks, strict=True):
        parts += [row.tobytes(), struct.pack("<Q", count), bytes(8 * count)]
    return b"".join(parts), rows


@given(st.lists(st.integers(0, 40), max_size=30))
@examples(max_examples=60, deadline=None)
def test_binary_points_are_what_was_written(tmp_path_factory, tracks):
    path = tmp_path_factory.mktemp("points") / "points3D.bin"
    data, rows = points_file(tracks)
    path.write_bytes(data)
    for found, key in zip(_binary_points(path), ("id", "xyz", "rgb", "error"), strict=True):
        np.testing.assert_array_equal(found, rows[key])


@given(st.data())
@examples(max_examples=60, deadline=None)
def test_damaged_binary_points_are_refused_or_as_many(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("points") / "points3D.bin"
    content, rows = points_file([3, 0, 5, 2])
    content = bytearray(content)
    kind = data.draw(st.sampled_from(("cut", "count", "length")))
    if kind == "cut":
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        place = 0 if kind == "count" else 8 + POINT.itemsize
        content[place : place + 8] = struct.pack("<Q", data.draw(st.integers(0, 2**64 - 1)))
    path.write_bytes(content)
    try:
        found = _binary_points(path)
    except InputError as error:
        assert "points3D.bin" in str(error)
    else:
        assert len(found[0]) <= len(rows)


def test_points_that_are_none_are_left_out_and_counted(written, settings):
    root = written("colmap")
    path = root / "sparse/0/points3D.txt"
    scene = read_scene(settings(root))
    whole = scene.given_points()
    lines = path.read_text().split("\n")
    for index, place in ((1, "nan 0 0"), (2, "inf 1 1"), (3, "0 0 0"), (4, "0 0 0"), (5, "1e308 1e308 1e308")):
        words = lines[index].split(" ")
        lines[index] = " ".join([words[0], *place.split(), *words[4:]])
    path.write_text("\n".join(lines))
    points = read_scene(settings(root, unit=10.0)).given_points()
    assert len(points) == len(whole) - 5 and points.left_out == 5
    assert np.isfinite(points.xyz).all()
    cameras = {frame.name: frame.camera for frame in read_scene(settings(root, unit=10.0)).train}
    for name in points.tracks.frames:
        index, pixel = points.tracks.of_frame(name)
        np.testing.assert_allclose(cameras[name].project(points.xyz[index])[0], pixel, atol=1e-3)


def test_a_model_without_points_is_read(written, settings):
    root = written("colmap")
    (root / "sparse/0/points3D.txt").unlink()
    scene = read_scene(settings(root))
    assert len(scene.frames) == 6 and scene.given_points is None


def hiding(made) -> np.ndarray:
    mask = np.full((made.height, made.width), 255, np.uint8)
    mask[:, :24] = 0
    return mask


@pytest.mark.parametrize(
    "name",
    [
        "masks/walk one/IMG_{}.jpg.png",
        "masks/walk one/IMG_{}.png",
        "masks/walk one/IMG_{}_mask.png",
        "masks/walk one/mask_IMG_{}.png",
        "masks/walk one/IMG_{}.mask.png",
        "masks/IMG_{}.png",
        "mask/IMG_{}_mask.png",
        "masks_people/walk one/IMG_{}.png",
        "images_masks/IMG_{}.jpg.png",
        "masks/walk one/IMG_{}.jpg",
    ],
)
def test_masks_are_found_by_the_ways_in_which_people_call_them(written, settings, made, name):
    root = written("colmap")
    for index in range(made.count):
        path = root / name.format(index + 7)
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), hiding(made), [cv2.IMWRITE_JPEG_QUALITY, 100])
    shares = [frame.mask().mean() for frame in read_scene(settings(root)).frames]
    np.testing.assert_allclose(shares, [0.75] * 6, atol=0.02)


def test_of_several_folders_of_masks_the_one_that_fits_is_used(written, settings, made):
    root = written("colmap")
    for folder, name in (("masks", "frame{}.png"), ("masks_walls", "walk one/IMG_{}.png"), ("mask", "IMG_9{}.png")):
        for index in range(made.count):
            path = root / folder / name.format(index + 7)
            path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(path), hiding(made))
    scene = read_scene(settings(root))
    assert all(frame.mask() is not None for frame in scene.frames)
    assert any("masks_walls is used for 6 of 6 photos, masks, mask beside it not" in note for note in scene.notes)


def test_flat_masks_of_photos_of_one_name_in_two_folders_are_nobody_s(tmp_path):
    cv2.imwrite(str(tmp_path / "0000.png"), np.zeros((4, 4), np.uint8))
    assert mask_files(tmp_path, ["left/0000.jpg", "right/0000.jpg"]) == {}
    assert set(mask_files(tmp_path, ["left/0000.jpg", "right/0001.jpg"])) == {"left/0000.jpg"}


def test_depth_beside_a_model_is_not_read_and_named(written, settings, made):
    root = written("colmap")
    (root / "depth").mkdir()
    for index in range(made.count):
        cv2.imwrite(str(root / f"depth/IMG_{index + 7}.png"), made.depths[index])
    scene = read_scene(settings(root))
    assert all(frame.depth_path is None for frame in scene.frames)
    said = [line for line in (*scene.notes, *scene.warnings) if "depth has 6 files" in line]
    assert len(said) == 1 and "not read" in said[0] and "prior.depth.path" in said[0]


def test_camera_files_have_their_frame_s_own_numbers_and_refuse_what_is_bad(written, made):
    root = written("nerfstudio")
    known = json.loads((root / "transforms.json").read_text())
    for frame in known["frames"]:
        frame["fl_x"] = known["fl_x"]
    known["fl_x"] *= 2
    (root / "transforms.json").write_text(json.dumps(known))
    assert {camera.K[0, 0] for _, camera in read_cameras(root / "transforms.json")} == {made.K[0, 0]}
    del known["frames"][1]["transform_matrix"]
    (root / "transforms.json").write_text(json.dumps(known))
    with pytest.raises(InputError, match="transform_matrix"):
        read_cameras(root / "transforms.json")


def test_photos_of_one_name_in_two_folders_keep_their_own_names(written, settings, made):
    root = written("colmap")
    text = (root / "sparse/0/images.txt").read_text()
    for index in range(made.count):
        name = f"{'left' if index < 3 else 'right'}/{index % 3:04d}.jpg"
        (root / "images" / name).parent.mkdir(exist_ok=True)
        (root / f"images/walk one/IMG_{index + 7}.jpg").rename(root / "images" / name)
        text = text.replace(f"walk one/IMG_{index + 7}.jpg\n", f"{name}\n")
    (root / "sparse/0/images.txt").write_text(text)
    frames = read_scene(settings(root)).frames
    assert [frame.name for frame in frames] == [f"{side}_{i:04d}" for side in ("left", "right") for i in range(3)]
    assert all(frame.shares_stem for frame in frames)
    assert not any(frame.shares_stem for frame in read_scene(settings(written("colmap_binary"))).frames)


def test_names_that_would_be_one_file_s_are_refused(written, settings):
    root = written("colmap")
    text = root / "sparse/0/images.txt"
    shutil.copy(root / "images/walk one/IMG_8.jpg", root / "images/Walk one_IMG_7.png")
    text.write_text(text.read_text().replace("walk one/IMG_8.jpg", "Walk one_IMG_7.png"))
    with pytest.raises(InputError, match=r"would both be called Walk one_IMG_7|would both be called walk one_IMG_7"):
        read_scene(settings(root))


def test_an_image_of_another_camera_keeps_it(written, settings, made):
    """Only cameras that images have are made; each image has its own."""
    root = written("colmap")
    cameras, images = root / "sparse/0/cameras.txt", root / "sparse/0/images.txt"
    cameras.write_text(cameras.read_text() + "0012 PINHOLE 96 72 60 61 48 36\n")
    images.write_text(images.read_text().replace(" 3 walk one/IMG_9.jpg", " 12 walk one/IMG_9.jpg"))
    focal = [frame.camera.K[0, 0] for frame in read_scene(settings(root)).frames]
    assert focal == [made.K[0, 0]] * 2 + [60.0] + [made.K[0, 0]] * 3


def test_more_photos_gone_than_half_are_refused_with_the_numbers(written, settings, made):
    root = written("colmap", made=replace(made, jpegs=None))
    for index in range(4):
        (root / f"images/walk one/IMG_{index + 7}.jpg").unlink()
    with pytest.raises(InputError, match=r"4.* of 6"):
        read_scene(settings(root))


def test_a_camera_file_with_a_pose_that_is_none_is_refused(written):
    root = written("colmap")
    path = root / "sparse/0/images.txt"
    lines = path.read_text().split("\n")
    words = lines[1].split(" ")
    lines[1] = " ".join([*words[:5], "nan", *words[6:]])
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match="no usable pose of image walk one/IMG_7"):
        read_cameras(root / "sparse/0")


def test_more_images_than_a_capture_has_are_refused_before_they_are_made(tmp_path):
    record = struct.pack("<I7dI", 1, 1, 0, 0, 0, 0, 0, 0, 1) + b"\0" + struct.pack("<Q", 0)
    (tmp_path / "images.bin").write_bytes(struct.pack("<Q", 200_001) + record * 200_001)
    (tmp_path / "cameras.bin").write_bytes(struct.pack("<Q", 0))
    with pytest.raises(InputError, match="names 200,001 photos"):
        read_model(tmp_path)


def test_some_photos_without_poses_are_noted(written, settings):
    root = written("colmap")
    shutil.copy(root / "images/walk one/IMG_7.jpg", root / "images/more.jpg")
    scene = read_scene(settings(root))
    assert any("poses of 6 of the 7 photos" in note for note in scene.notes) and scene.warnings == ()


def test_a_model_with_rigs_and_frames_is_the_same(written, settings, tmp_path):
    from room2dgs.colmap import pycolmap

    root = written("colmap")
    (root / "images/walk one").rename(root / "images/walk")  # its reader of text ends names at a space
    text = root / "sparse/0/images.txt"
    text.write_text(text.read_text().replace("walk one/", "walk/"))
    before = read_scene(settings(root))
    (root / "again").mkdir()
    pycolmap.Reconstruction(str(root / "sparse/0")).write_binary(str(root / "again"))
    assert (root / "again/rigs.bin").exists() and (root / "again/frames.bin").exists()
    shutil.rmtree(root / "sparse/0")
    shutil.move(root / "again", root / "sparse/0")
    after = read_scene(settings(root))
    for old, new in zip(before.frames, after.frames, strict=True):
        np.testing.assert_allclose(new.camera.cam_from_world, old.camera.cam_from_world, atol=1e-12)
        np.testing.assert_allclose(new.camera.K, old.camera.K, atol=1e-12)
    np.testing.assert_allclose(
        np.sort(after.given_points().xyz, axis=0), np.sort(before.given_points().xyz, axis=0), atol=1e-12
    )
    assert len(after.given_points().tracks) == len(before.given_points().tracks)
