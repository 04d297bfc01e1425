"""transforms.json: of several meanings the right one, every key used or named, a bad frame left out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs.captures.lens import Lens
from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError

FOCAL = ("fl_x", "fl_y", "cx", "cy", "w", "h")


@pytest.fixture
def changed(written):
    """`changed(change)` writes the capture in nerfstudio's layout and lets `change` edit its transforms.json."""

    def write(change):
        root = written("nerfstudio")
        path = root / "transforms.json"
        known = json.loads(path.read_text())
        change(known)
        path.write_text(json.dumps(known))
        return root

    return write


def intrinsics_off(scene, made) -> float:
    return max(float(np.abs(frame.camera.K - made.K).max()) for frame in scene.frames)


def own_intrinsics(known, keys=FOCAL) -> None:
    for frame in known["frames"]:
        frame.update({key: known[key] for key in keys})


def test_a_frame_s_own_focal_length_wins_and_both_numbers_are_named(changed, settings, made):
    def change(known):
        own_intrinsics(known)
        known["fl_x"] *= 1.3
        known["fl_y"] *= 1.3

    scene = read_scene(settings(changed(change)))
    assert intrinsics_off(scene, made) < 1e-9
    said = [line for line in scene.warnings if "fl_x" in line]
    assert len(said) == 1 and "105.3" in said[0] and "fl_x=81" in said[0] and "6 of 6" in said[0]


def test_the_same_numbers_at_both_places_are_no_contradiction(changed, settings, made):
    scene = read_scene(settings(changed(own_intrinsics)))
    assert intrinsics_off(scene, made) < 1e-9 and scene.warnings == ()


def test_a_frame_s_field_of_view_wins_over_a_focal_length_at_the_top(changed, settings, made):
    def change(known):
        for frame in known["frames"]:
            frame["camera_angle_x"] = 2 * np.arctan(known["w"] / 2 / known["fl_x"])
            frame["camera_angle_y"] = 2 * np.arctan(known["h"] / 2 / known["fl_y"])
        known["fl_x"] = known["fl_y"] = 300.0

    assert intrinsics_off(read_scene(settings(changed(change))), made) < 1e-9


def test_photos_of_train_test_and_val_have_the_intrinsics_of_their_own_file(written, settings, made):
    root = written("nerfstudio")
    known = json.loads((root / "transforms.json").read_text())
    (root / "transforms.json").unlink()
    test = {**known, "frames": known["frames"][4:], "fl_x": known["fl_x"] * 1.25}
    (root / "transforms_train.json").write_text(json.dumps({**known, "frames": known["frames"][:4]}))
    for name in ("test", "val"):
        (root / f"transforms_{name}.json").write_text(json.dumps(test))
    scene = read_scene(settings(root))
    assert [frame.camera.K[0, 0] for frame in scene.train] == [made.K[0, 0]] * 4
    assert [frame.camera.K[0, 0] for frame in scene.test] == [made.K[0, 0] * 1.25] * 2
    assert any("transforms_val.json beside it not" in note for note in scene.notes)
    (root / "transforms_test.json").unlink()
    assert len(read_scene(settings(root)).test) == 2  # of val, where there is no test


def test_parts_in_different_worlds_are_refused(written, settings):
    root = written("nerfstudio")
    known = json.loads((root / "transforms.json").read_text())
    (root / "transforms.json").rename(root / "transforms_train.json")
    moved = {**known, "frames": [], "applied_scale": 7.0}
    moved["frames"] = [{**known["frames"][0], "file_path": "images/other.png"}]
    (root / "transforms_test.json").write_text(json.dumps(moved))
    with pytest.raises(InputError, match="different applied_transform or applied_scale"):
        read_scene(settings(root))


def test_all_coefficients_of_opencv_s_rational_lens_are_read(changed, settings, made):
    k = {"k1": 0.1, "k2": -0.02, "p1": 0.001, "p2": -0.002, "k3": 0.003, "k4": 0.08, "k5": -0.01, "k6": 0.002}

    scene = read_scene(settings(changed(lambda known: known.update(k))))
    fx, fy, cx, cy = made.fx_fy_cx_cy
    assert {frame.lens for frame in scene.frames} == {
        Lens("FULL_OPENCV", (fx, fy, cx, cy, *k.values()), made.size, scene.frames[0].lens.source)
    }


def test_k4_alone_is_refused_because_it_has_two_meanings(changed, settings):
    with pytest.raises(InputError, match=r"k4 alone.*FULL_OPENCV"):
        read_scene(settings(changed(lambda known: known.update(k4=0.01))))
    root = changed(lambda known: known.update(k4=0.01, camera_model="FULL_OPENCV"))
    assert read_scene(settings(root)).frames[0].lens.params[9] == 0.01


def test_k5_of_a_fisheye_is_refused(changed, settings):
    with pytest.raises(InputError, match="fisheye camera with k5"):
        read_scene(settings(changed(lambda known: known.update(k1=0.01, k5=0.01, is_fisheye=True))))


@pytest.mark.parametrize(("unit", "metres"), [("auto", 1.0), (0.5, 0.5)])
def test_depth_of_instant_ngp_is_in_units_of_the_poses(changed, settings, made, unit, metres):
    def change(known):
        for frame in known["frames"]:
            frame["depth_path"] = frame.pop("depth_file_path")
        known.update(enable_depth_loading=True, integer_depth_scale=0.001)

    scene = read_scene(settings(changed(change), unit=unit))
    for frame, depth in zip(scene.frames, made.depths, strict=True):
        np.testing.assert_allclose(frame.depth(), depth / 1000 * metres, atol=5e-7)


@pytest.mark.parametrize(("keys", "why"), [({}, "integer_depth_scale"), ({"enable_depth_loading": False}, "false")])
def test_depth_of_instant_ngp_that_is_not_read_is_named(changed, settings, keys, why):
    def change(known):
        for frame in known["frames"]:
            frame["depth_path"] = frame.pop("depth_file_path")
        known.pop("depth_unit_scale_factor", None)
        known.update(keys)

    scene = read_scene(settings(changed(change)))
    assert all(frame.depth_path is None for frame in scene.frames)
    assert any("depth_path in 6 frames, which is not read" in line and why in line for line in scene.warnings)


def test_points_that_are_not_there_are_done_without(changed, settings):
    scene = read_scene(settings(changed(lambda known: known.update(ply_file_path="sparse_pc.ply"))))
    assert scene.given_points is None
    assert any("sparse_pc.ply as ply_file_path, which is not there" in note for note in scene.notes)


def test_keys_that_could_change_the_geometry_are_named_and_others_are_not(changed, settings):
    def change(known):
        known.update(aabb_scale=4, scale=0.3, offset=[0.5, 0.5, 0.5], orientation_override="none", lens_shift=0.1)
        known["rolling_shutter"] = [0.0, 0.0, 0.03]
        for frame in known["frames"]:
            frame.update(sharpness=30.0, colmap_im_id=3, principal_shift=2)

    scene = read_scene(settings(changed(change)))
    said = " ".join((*scene.notes, *scene.warnings))
    assert "lens_shift" in said and "principal_shift" in said and "rolling_shutter" in said
    assert not any(key in said for key in ("aabb_scale", "sharpness", "orientation_override", "colmap_im_id"))


@pytest.mark.parametrize("key", ["equirectangular", "latlong", "ftheta_p0", "normal_mts_args"])
def test_cameras_and_axes_that_are_not_read_are_refused(changed, settings, key):
    with pytest.raises(InputError, match=key):
        read_scene(settings(changed(lambda known: known.update({key: 1.0}))))


def many(made, count=24):
    """The made scene with more photos: the first ones again, a step to the side."""
    index = np.arange(count) % made.count
    poses = made.poses[index].copy()
    poses[:, 0, 3] += 0.1 * (np.arange(count) // made.count)
    return replace(
        made,
        poses=poses,
        photos=made.photos[index],
        depths=made.depths[index],
        seen=[made.seen[i] for i in index],
        jpegs=None,
    )


@pytest.mark.parametrize(
    ("damage", "word"),
    [
        (lambda frame: frame.pop("transform_matrix"), "transform_matrix"),
        (lambda frame: frame.update(transform_matrix=[[1, 2], [3, 4]]), "transform_matrix"),
        (lambda frame: frame["transform_matrix"][0].__setitem__(3, float("nan")), "NaN"),
        (lambda frame: frame.update(transform_matrix="no"), "no number"),
    ],
)
def test_one_frame_with_a_bad_pose_costs_itself(written, settings, made, damage, word):
    root = written("nerfstudio", made=many(made))
    known = json.loads((root / "transforms.json").read_text())
    damage(known["frames"][5])
    name = known["frames"][5]["file_path"]
    (root / "transforms.json").write_text(json.dumps(known))
    scene = read_scene(settings(root))
    assert len(scene.frames) == 23
    assert [one.name for one in scene.dropped] == [name.removeprefix("./").replace("/", "_").rpartition(".")[0]]
    assert word in scene.dropped[0].reason


def test_one_frame_without_a_name_costs_itself_and_many_are_refused(written, settings, made):
    root = written("nerfstudio", made=many(made))
    known = json.loads((root / "transforms.json").read_text())
    del known["frames"][5]["file_path"]
    (root / "transforms.json").write_text(json.dumps(known))
    scene = read_scene(settings(root))
    assert len(scene.frames) == 23 and any("frame 5" in line for line in scene.warnings)
    known["frames"][6] = known["frames"][7] = "no object"
    (root / "transforms.json").write_text(json.dumps(known))
    with pytest.raises(InputError, match=r"file_path.*3 "):
        read_scene(settings(root))


@pytest.mark.parametrize(("gone", "read"), [(1, True), (3, True), (4, False)])
def test_photos_that_are_not_there_are_left_out_up_to_a_half(written, settings, gone, read):
    root = written("nerfstudio")
    for path in sorted((root / "images").iterdir())[:gone]:
        path.unlink()
    if read:
        scene = read_scene(settings(root))
        assert len(scene.frames) == 6 - gone and len(scene.dropped) == gone
        assert all("is missing" in one.reason for one in scene.dropped)
        assert any(f"{gone} of 6" in line for line in scene.warnings)
    else:
        with pytest.raises(InputError, match=r"is missing.*4"):
            read_scene(settings(root))


def test_a_photo_that_is_gone_is_not_opened_for_its_size(written, settings, made):
    root = written("nerfstudio")
    known = json.loads((root / "transforms.json").read_text())
    del known["w"], known["h"]
    (root / "transforms.json").write_text(json.dumps(known))
    next((root / "images").iterdir()).unlink()
    scene = read_scene(settings(root))
    assert len(scene.frames) == 5 and intrinsics_off(scene, made) < 1e-9


def test_a_frame_that_is_there_twice_is_taken_once_and_with_two_poses_refused(changed, settings):
    scene = read_scene(settings(changed(lambda known: known["frames"].append(known["frames"][0]))))
    assert len(scene.frames) == 6 and any("twice" in note for note in scene.notes)

    def move(known):
        other = json.loads(json.dumps(known["frames"][0]))
        other["transform_matrix"][0][3] += 1.0
        known["frames"].append(other)

    with pytest.raises(InputError, match="twice"):
        read_scene(settings(changed(move)))


def test_depth_maps_that_are_gone_cost_their_photo_nothing(written, settings, made):
    root = written("nerfstudio")
    known = json.loads((root / "transforms.json").read_text())
    (root / known["frames"][2]["depth_file_path"]).unlink()
    scene = read_scene(settings(root))
    assert len(scene.frames) == 6 and sum(frame.depth_path is None for frame in scene.frames) == 1
    assert any("6 depth maps, 1 of which are not there" in line for line in scene.warnings)


def test_masks_of_instant_ngp_hide_where_they_are_not_black(written, settings, made):
    root = written("instant_ngp")
    photo = next(iter(json.loads(next(root.glob("transforms*.json")).read_text())["frames"]))["file_path"]
    folder = (root / photo).parent
    hidden = np.zeros((made.height, made.width, 3), np.uint8)
    hidden[:, :24, 2] = 3
    for path in list(folder.iterdir()):
        if path.suffix in (".png", ".jpg"):
            cv2.imwrite(str(folder / f"dynamic_mask_{path.stem}.png"), hidden)
    scene = read_scene(settings(root))
    for frame in scene.frames:
        np.testing.assert_array_equal(frame.mask()[:, :23], False)
        np.testing.assert_array_equal(frame.mask()[:, 25:], True)


def test_a_folder_of_masks_that_no_frame_names_is_told(written, settings, made):
    root = written("nerfstudio")
    (root / "masks").mkdir()
    cv2.imwrite(str(root / "masks" / "frame_00001.png"), np.full((made.height, made.width), 255, np.uint8))
    scene = read_scene(settings(root))
    said = [line for line in scene.warnings if "masks" in line]
    assert len(said) == 1 and "no frame names a mask (mask_path)" in said[0]


def test_some_frames_without_intrinsics_are_not_all_of_them(changed, settings):
    def some(known):
        own = {key: known.pop(key) for key in ("fl_x", "fl_y", "cx", "cy")}
        for frame in known["frames"][:3]:
            frame.update(own)

    with pytest.raises(InputError, match=r"frame_000\d\d\.png, unlike other photos, has no intrinsics"):
        read_scene(settings(changed(some)))


def test_names_without_a_suffix_that_fit_several_files_are_told(written, settings):
    root = written("instant_ngp")
    assert not read_scene(settings(root)).warnings
    names = [frame["file_path"] for frame in json.loads((root / "transforms.json").read_text())["frames"]]
    assert not any(Path(name).suffix for name in names)
    photo = next((root / names[0]).parent.glob(Path(names[0]).name + ".*"))
    photo.with_suffix(".jpg" if photo.suffix == ".png" else ".png").write_bytes(photo.read_bytes())
    (told,) = read_scene(settings(root)).warnings
    assert told.startswith("1 photos are named without their suffix and there are several of each: ")


@pytest.mark.parametrize("name", ["gt_mesh.ply", "gt_mesh.obj", "gt_mesh.glb"])
def test_a_truth_of_any_kind_of_mesh_is_found(written, settings, name):
    root = written("nerfstudio")
    trimesh.creation.box().export(root / name)
    assert read_scene(settings(root)).gt_mesh == root / name
