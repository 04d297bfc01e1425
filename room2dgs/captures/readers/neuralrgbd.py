"""Neural RGB-D's synthetic rooms: images/img<i>.png, depth/, poses.txt (4 lines a pose), gt_mesh.ply.

Poses are camera-to-world with OpenGL axes, metres; the focal length is in focal.txt or the dataset's own, the principal
point in the middle. A photo's pose and depth are those of its number. poses.txt is the truth, trainval_poses.txt what
BundleFusion estimated.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from room2dgs.captures.capture import C2W_OPENGL, Capture, Shot, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, photos_in
from room2dgs.captures.pairing import alike, note_on, places
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.pose_rows import pose_rows
from room2dgs.captures.reader import Reader
from room2dgs.captures.text_files import floats, lines_of
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "images/img0.png and poses.txt (Neural RGB-D)"
FOCAL = 554.2562584220408
POSES = ("poses.txt", "trainval_poses.txt")
MOST_DAMAGED = 20  # photos in a row
DEPTHS = ("depth", "depth_filtered", "depth_with_noise")


def is_neuralrgbd(files: Listing) -> bool:
    return "images" in files and any(name in files for name in POSES)


def read_neuralrgbd(root: Path, config: SceneConfig) -> Capture:
    """Read a room.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    path = next((root / name for name in POSES if (root / name).is_file()), root / POSES[0])
    poses, damage = pose_rows(path, 4)
    photos = photos_in(root / "images")
    if not photos:
        raise InputError(f"{root / 'images'} has no photos; a capture in this layout has {LAYOUT}")
    folder = next((root / name for name in DEPTHS if (root / name).is_dir()), None)
    maps = [name for name in listed(folder) if name.endswith(".png")] if folder else []
    place, depths = places(photos, len(poses), path, maps, damage=damage), alike(photos, maps)
    width, height = _size([root / "images" / name for name in photos])
    focal_path = root / "focal.txt"
    focal = floats(lines_of(focal_path)[0][1], focal_path, 1)[0] if _has_line(focal_path) else FOCAL * width / 640
    lens = pinhole_lens(focal, focal, width / 2, height / 2, (width, height), path, True)
    shots = [
        Shot(
            name,
            root / "images" / name,
            poses[place[name]],
            lens,
            depth=depth_file(folder / depths[name]) if folder and name in depths else None,
        )
        for name in photos
    ]
    notes = [f"poses: {path.name}" + (f"; depth: {folder.name}/" if folder and depths else "")]
    notes += note_on(len(photos), len(poses), path)
    return Capture(
        root, "neuralrgbd", shots, C2W_OPENGL, gt_mesh=gt_mesh_in(root), notes=notes, why="Neural RGB-D is in metres"
    )


def _size(photos: list[Path]) -> tuple[int, int]:
    """(width, height) of the first photo that can be read."""
    for path in photos[:MOST_DAMAGED]:
        with suppress(InputError):
            return PhotoFile(path).size()
    return PhotoFile(photos[0]).size()


def _has_line(path: Path) -> bool:
    return path.is_file() and bool(lines_of(path))


READER = Reader(is_neuralrgbd, read_neuralrgbd, LAYOUT)
