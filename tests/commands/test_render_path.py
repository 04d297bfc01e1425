"""`room2dgs render` along paths: what is written, that it is right, and what is refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from room2dgs import cli
from room2dgs.captures.camera_file import read_cameras
from room2dgs.config import dump_config, load_config
from room2dgs.splat.types import Surfels
from room2dgs.train.surfel_file import load_surfels, save_surfels

WALL_Z = 2.0
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def run(wall, tmp_path_factory) -> Path:
    """A run of the wall, red on the left and blue on the right of x = 0.35 m, without any training."""
    out = tmp_path_factory.mktemp("paths") / "run"
    out.mkdir()
    x, y = torch.meshgrid(torch.arange(-2, 3, 0.05), torch.arange(-1.5, 1.5, 0.05), indexing="ij")
    centers = torch.stack([x.ravel(), y.ravel(), torch.full((x.numel(),), WALL_Z)], dim=1)
    count = len(centers)
    red = (centers[:, :1] < 0.35).float()
    rgb = torch.cat([red, torch.zeros(count, 1), 1 - red], dim=1)
    sh = ((rgb - 0.5) / 0.28209479)[:, None]
    rotations = torch.tensor([[1.0, 0, 0, 0]]).repeat(count, 1)
    surfels = Surfels(centers, rotations, torch.full((count, 2), 0.04), torch.full((count,), 0.95), sh)
    save_surfels(out / "surfels.safetensors", surfels, {})
    (out / "config.yaml").write_text(dump_config(load_config([f"scene.path={wall}", f"out={out}"])))
    return out


def render(run: Path, *arguments: str) -> int:
    return cli.main(["render", f"run={run}", *arguments])


def test_a_smooth_path_is_written_whole_and_the_same_again(run, tmp_path):
    arguments = ("path=smooth", "frames=7", "save=color,depth,depth_npy,normals,video", "fps=5")
    assert render(run, *arguments) == 0
    folder = run / "renders" / "smooth"
    endings = (".png", ".depth.png", ".depth.npy", ".normals.png")
    names = {f"{index:05d}{ending}" for index in range(7) for ending in endings}
    assert {path.name for path in folder.iterdir()} == names | {"video.mp4"}
    video = cv2.VideoCapture(str(folder / "video.mp4"))
    codec = int(video.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little").decode().lower()
    assert codec in ("vp09", "vp90", "avc1", "h264")  # what browsers play
    pictures = []
    while (one := video.read())[0]:
        pictures.append(one[1][..., ::-1])
    assert len(pictures) == 7 and pictures[0].shape == (48, 64, 3) and video.get(cv2.CAP_PROP_FPS) == 5
    for index, picture in enumerate(pictures):
        still = cv2.imread(str(folder / f"{index:05d}.png"))[..., ::-1].astype(float)
        assert np.abs(picture - still).mean() < 12  # a lossy format
    assert render(run, *arguments, f"to={tmp_path / 'again'}", "render.threads=1") == 0
    for name in (*names, "video.mp4"):
        assert (folder / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name


def test_depth_is_metres_and_millimetres(run, tmp_path):
    assert render(run, "path=smooth", "frames=1", "width=32", "save=depth,depth_npy", f"to={tmp_path}") == 0
    metres = np.load(tmp_path / "00000.depth.npy")
    millimetres = cv2.imread(str(tmp_path / "00000.depth.png"), cv2.IMREAD_UNCHANGED)
    assert metres.shape == (24, 32) and metres.dtype == np.float32 and millimetres.dtype == np.uint16
    assert np.allclose(metres, WALL_Z, atol=1e-3)
    assert np.abs(millimetres - metres * 1000.0).max() <= 0.5


def test_depth_that_millimetres_do_not_hold_is_unknown_in_every_command_and_told(run, wall, tmp_path, capsys):
    """Two walls: 2 m and 70 m away."""
    far = tmp_path / "far"
    shutil.copytree(run, far)
    x = torch.arange(-60, 60, 1.0)
    x, y = (part.ravel() for part in torch.meshgrid(x, x, indexing="ij"))
    behind = torch.stack([x, y, torch.full_like(x, 70.0)], dim=1)
    count = len(behind)
    there = load_surfels(run / "surfels.safetensors")
    near = there.centers[:, 0] < 0.35
    parts = (
        behind,
        torch.tensor([[1.0, 0, 0, 0]]).repeat(count, 1),
        torch.full((count, 2), 0.8),
        torch.full((count,), 0.95),
        torch.zeros(count, 1, 3),
    )
    both = Surfels(*(torch.cat([one[near], other]) for one, other in zip(there, parts, strict=True)))
    save_surfels(far / "surfels.safetensors", both, {})
    file = tmp_path / "here.json"
    meta = {"w": 64, "h": 48, "fl_x": 50.0, "fl_y": 50.0, "cx": 32.0, "cy": 24.0}
    file.write_text(json.dumps(meta | {"frames": [{"file_path": "0.png", "transform_matrix": FLIP.tolist()}]}))
    assert render(far, f"path={file}", "save=depth,depth_npy") == 0
    rendered = capsys.readouterr().out
    exported = [f"run={far}", "to=depth,depth_npy", "points.source=file", f"points.file={wall / 'points.ply'}"]
    assert cli.main(["export", *exported]) == 0
    folder = far / "renders" / "here"
    pairs = [
        (folder / "0.depth.png", folder / "0.depth.npy"),
        (far / "export/depth/000000.png", far / "export/depth_npy/000000.npy"),
    ]
    for png, npy in pairs:
        millimetres, metres = cv2.imread(str(png), cv2.IMREAD_UNCHANGED), np.load(npy)
        assert (metres > 65.535).mean() > 0.2 and (metres == 0).mean() < 0.1
        assert (millimetres[metres > 65.535] == 0).all()
        assert np.abs(millimetres - metres * 1000.0)[metres < 60].max() <= 0.5
    assert "1 views are farther than 65.535 m" in rendered and "save=depth_npy writes metres" in rendered
    assert "8 views are farther than 65.535 m" in (said := capsys.readouterr().out) and "to=depth_npy" in said


def test_cameras_of_a_file_see_what_stands_there(run, tmp_path):
    pose = np.eye(4)
    pose[0, 3] = 0.35  # in the middle, red left of it; the second looks the other way and sees nothing
    frames = [
        {"file_path": "there.jpg", "transform_matrix": (pose @ FLIP).tolist()},
        {"file_path": "back.jpg", "transform_matrix": pose.tolist()},
    ]
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"w": 60, "h": 40, "fl_x": 50.0, "frames": frames}))
    assert render(run, f"path={file}", "save=color") == 0
    picture = cv2.imread(str(run / "renders" / "cameras" / "there.png"))[..., ::-1]
    assert picture.shape == (40, 60, 3)
    assert picture[20, 10].argmax() == 0 and picture[20, 50].argmax() == 2
    assert cv2.imread(str(run / "renders" / "cameras" / "back.png")).max() == 0


def test_a_colmap_model_and_a_transforms_json_say_the_same(tmp_path):
    text = "1 PINHOLE 60 40 50 50 30 20\n"
    (tmp_path / "cameras.txt").write_text(text)
    (tmp_path / "images.txt").write_text("1 0.9238795325 0 0.3826834324 0 0.1 0.2 0.3 1 one.jpg\n\n")
    ((name, camera),) = read_cameras(tmp_path)
    file = tmp_path / "t.json"
    frame = {"file_path": "one.jpg", "transform_matrix": (camera.world_from_cam @ FLIP).tolist()}
    intrinsics = {"w": 60, "h": 40, "fl_x": 50, "fl_y": 50, "cx": 30, "cy": 20}
    file.write_text(json.dumps({**intrinsics, "frames": [frame]}))
    ((other_name, other),) = read_cameras(file)
    assert name == other_name == "one"
    assert np.allclose(camera.cam_from_world, other.cam_from_world) and np.array_equal(camera.K, other.K)
    assert camera.cam_from_world[0, 3] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["path=nowhere.json"], "is no camera file"),
        (["frames=3"], "add path=smooth"),
        (["path=smooth", "views=all"], "exclude each other"),
        (["path=smooth", "save=colour"], "choose from color"),
        (["path=smooth", "frames=0"], "from 1 to"),
        (["views=some"], "choose from test"),
    ],
)
def test_what_is_refused(run, arguments, said, capsys):
    assert render(run, *arguments) == 2
    words = capsys.readouterr().err
    assert said in words and words.count("\n") == 1


def test_a_camera_file_without_sizes_is_refused(run, tmp_path, capsys):
    file = tmp_path / "t.json"
    file.write_text(json.dumps({"fl_x": 50, "frames": [{"transform_matrix": np.eye(4).tolist()}]}))
    assert render(run, f"path={file}") == 2
    assert "w and h" in capsys.readouterr().err
