"""Two cameras whose photos have the same file names: every file of a photo is its own."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest

from room2dgs import cli
from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.depth.files import find_map
from room2dgs.errors import InputError
from room2dgs.tools.simulate_priors import PriorOptions, simulate_priors

NAMES = [f"{side}/{index:04d}.png" for side in ("left", "right") for index in range(4)]
FRAMES = [name.replace("/", "_").removesuffix(".png") for name in NAMES]


@pytest.fixture(scope="module")
def two_cameras(wall, tmp_path_factory):
    """The wall's photos in left/ and right/ of a transforms.json, with depth in millimetres."""
    root = tmp_path_factory.mktemp("two") / "cameras"
    frames = []
    for index, name in enumerate(NAMES):
        for folder in ("images", "depth"):
            (root / folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(wall / f"color/{index}.png", root / "images" / name)
        height, width = cv2.imread(str(root / "images" / name)).shape[:2]
        cv2.imwrite(str(root / "depth" / name), np.full((height, width), 2000, np.uint16))
        pose = np.loadtxt(wall / f"pose/{index}.txt") @ np.diag([1.0, -1.0, -1.0, 1.0])
        frame = {"file_path": f"images/{name}", "transform_matrix": pose.tolist()}
        frames.append({**frame, "depth_file_path": f"depth/{name}"})
    K = np.loadtxt(wall / "intrinsic/intrinsic_color.txt")
    known = {"fl_x": K[0, 0], "fl_y": K[1, 1], "cx": K[0, 2] + 0.5, "cy": K[1, 2] + 0.5, "w": width, "h": height}
    (root / "transforms.json").write_text(json.dumps({**known, "frames": frames}))
    return root


def frames_of(root):
    return read_scene(replace(load_config([f"scene.path={root}", "out=unused"]).scene, test_every=0)).frames


def test_depth_and_coverage_of_all_photos_are_kept_and_found_again(two_cameras, wall, tmp_path):
    out = tmp_path / "out"
    arguments = [f"scene.path={two_cameras}", f"out={out}", "points.source=file", f"points.file={wall / 'points.ply'}"]
    more = ["mesh.max_error_m=null", "mesh.voxel_m=0.04", "mesh.min_triangles=10", "scene.test_every=0"]
    assert cli.main(["depth", *arguments, *more, "report.enabled=false"]) == 0
    wanted = {f"images_{name}" for name in FRAMES}
    for kind in ("depth", "normal", "error", "num_consistent"):
        assert {path.stem for path in (out / kind).iterdir()} == wanted
    photos = json.loads((out / "coverage.json").read_text())["photos"]
    assert {photo["photo"] for photo in photos} == wanted
    for frame in frames_of(two_cameras):
        assert find_map(out / "depth", frame) == out / "depth" / f"{frame.name}.npy"
    for photo in photos:
        depth = np.load(out / "depth" / f"{photo['photo']}.npy")
        assert photo["stereo"] == pytest.approx(np.mean(depth > 0))


def test_maps_called_by_what_two_photos_have_in_common_are_refused(two_cameras, tmp_path):
    frames = frames_of(two_cameras)
    np.save(tmp_path / "0001.npy", np.ones((4, 4)))
    with pytest.raises(InputError, match=r"0001\.npy could be of .*0001\.png or of another.*images_left_0001"):
        find_map(tmp_path, frames[1])
    assert find_map(tmp_path, frames[2]) is None
    np.save(tmp_path / "images_left_0001.npy", np.ones((4, 4)))
    assert find_map(tmp_path, frames[1]) == tmp_path / "images_left_0001.npy"


def test_simulated_priors_of_all_photos_are_kept(two_cameras, tmp_path):
    simulate_priors(two_cameras, tmp_path / "priors", PriorOptions(depth_format="npy"))
    for kind in ("depth", "normal"):
        assert {path.stem for path in (tmp_path / "priors" / kind).iterdir()} == {f"images_{name}" for name in FRAMES}
    for frame in frames_of(two_cameras):
        assert find_map(tmp_path / "priors/depth", frame) is not None
