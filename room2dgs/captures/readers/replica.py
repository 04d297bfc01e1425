"""Replica as iMAP and NICE-SLAM rendered it: traj.txt, results/frame<i>.jpg, results/depth<i>.png, cam_params.json.

A line of traj.txt is a frame's camera-to-world: 16 numbers, OpenCV axes, metres; the number in a photo's name counts
lines from 0, so photos may be missing. Pixel centres are integers.
"""

from __future__ import annotations

from pathlib import Path

from room2dgs.captures.capture import Capture, Shot, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.known_keys import DISTORTION, check_no_distortion, unknown_keys
from room2dgs.captures.listing import PHOTO_SUFFIXES, Listing, gt_mesh_in, listed, natural
from room2dgs.captures.pairing import alike, note_on, places
from room2dgs.captures.pose_rows import pose_rows
from room2dgs.captures.reader import Reader
from room2dgs.captures.text_files import number, positive, read_json_object
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "traj.txt and results/frame000000.jpg (Replica)"
# where cam_params.json, which lies beside the scenes' folders, is missing
USUAL = {"w": 1200, "h": 680, "fx": 600.0, "fy": 600.0, "cx": 599.5, "cy": 339.5, "scale": 6553.5}


def is_replica(files: Listing) -> bool:
    return "traj.txt" in files and "results" in files


def read_replica(root: Path, config: SceneConfig) -> Capture:
    """Read one scene's folder.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    params, source, unknown = _params(root)
    size = int(number(params, "w", source)), int(number(params, "h", source))
    fx, fy, cx, cy = (number(params, key, source) for key in ("fx", "fy", "cx", "cy"))
    unit = 1.0 / positive(params, "scale", source)
    lens = pinhole_lens(fx, fy, cx, cy, size, source, config.pixel_centres == "half")
    path, folder = root / "traj.txt", root / "results"
    poses, damage = pose_rows(path, 1)
    names = natural(listed(folder))
    photos = [name for name in names if name.startswith("frame") and name.lower().endswith(PHOTO_SUFFIXES)]
    maps = [name for name in names if name.startswith("depth") and name.endswith(".png")]
    if not photos:
        raise InputError(f"{folder} has no photos; they are called frame000000.jpg and so on")
    place = places(photos, len(poses), path, maps, damage=damage)
    depths = alike(photos, maps)
    shots = [
        Shot(
            name,
            folder / name,
            poses[place[name]],
            lens,
            depth=depth_file(folder / depths[name], unit) if name in depths else None,
        )
        for name in photos
    ]
    notes = [*note_on(len(photos), len(poses), path), *unknown]
    mesh = gt_mesh_in(root) or gt_mesh_in(root.parent, f"{root.name}_mesh.ply", own=False)
    return Capture(root, "replica", shots, gt_mesh=mesh, why="Replica is rendered in metres", notes=notes)


def _params(root: Path) -> tuple[dict, Path, list[str]]:
    """The camera, the file that says so, and notes."""
    for path in (root / "cam_params.json", root.parent / "cam_params.json"):
        if path.is_file():
            camera = read_json_object(path).get("camera")
            if not isinstance(camera, dict):
                raise InputError(f"{path} has no object camera; copy it again")
            check_no_distortion(camera, path)
            unknown = unknown_keys(camera, {*USUAL, *DISTORTION}, path)
            return camera, path, [unknown] if unknown else []
    return USUAL, root / "cam_params.json", []


READER = Reader(is_replica, read_replica, LAYOUT)
