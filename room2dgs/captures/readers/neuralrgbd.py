"""Neural RGB-D's synthetic rooms: images/img<i>.png, depth/, poses.txt (4 lines a pose), gt_mesh.ply.

Poses are camera-to-world with OpenGL axes, metres; the focal length is in focal.txt or the dataset's own, the principal
point in the middle. poses.txt is the truth, trainval_poses.txt what BundleFusion estimated.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from room2dgs.captures.capture import C2W_OPENGL, Capture, Shot, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, natural, photos_in
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.text_files import floats, lines_of
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "images/img0.png and poses.txt (Neural RGB-D)"
FOCAL = 554.2562584220408
POSES = ("poses.txt", "trainval_poses.txt")
DEPTHS = ("depth", "depth_filtered", "depth_with_noise")


def is_neuralrgbd(files: Listing) -> bool:
    return "images" in files and any(name in files for name in POSES)


def read_neuralrgbd(root: Path, config: SceneConfig) -> Capture:
    """Read a room.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    path = next((root / name for name in POSES if (root / name).is_file()), root / POSES[0])
    rows = [floats(text, path, line, 4) for line, text in lines_of(path)]
    photos = photos_in(root / "images")
    if len(rows) % 4 or len(rows) // 4 < len(photos) or not photos:
        raise InputError(f"{path} has {len(rows)} lines for {len(photos)} photos in images/, 4 a photo belong there")
    poses = np.array(rows).reshape(-1, 4, 4)
    width, height = PhotoFile(root / "images" / photos[0]).size()
    focal_path = root / "focal.txt"
    focal = floats(lines_of(focal_path)[0][1], focal_path, 1)[0] if _has_line(focal_path) else FOCAL * width / 640
    lens = pinhole_lens(focal, focal, width / 2, height / 2, (width, height), path, True)
    folder = next((root / name for name in DEPTHS if (root / name).is_dir()), None)
    depths = natural(name for name in listed(folder) if name.endswith(".png")) if folder else []
    if depths and len(depths) != len(photos):
        raise InputError(f"{folder} has {len(depths)} depth maps for {len(photos)} photos; copy the room again")
    shots = [
        Shot(name, root / "images" / name, pose, lens, depth=depth_file(folder / depths[i]) if depths else None)
        for i, (name, pose) in enumerate(zip(photos, poses, strict=False))
    ]
    notes = [f"poses: {path.name}" + (f"; depth: {folder.name}/" if depths else "")]
    return Capture(
        root, "neuralrgbd", shots, C2W_OPENGL, gt_mesh=gt_mesh_in(root), notes=notes, why="Neural RGB-D is in metres"
    )


def _has_line(path: Path) -> bool:
    return path.is_file() and bool(lines_of(path))
