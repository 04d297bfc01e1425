"""ARKitScenes: <id>_frames/{lowres_wide,lowres_depth,lowres_wide_intrinsics,lowres_wide.traj}, <id>_3dod_mesh.ply.

The trajectory is world-to-camera (axis times angle, metres) with OpenCV axes, world z up. Each photo has a .pincam near
its time. Depth is millimetres.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from room2dgs.captures.capture import Capture, Lost, Shot, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, natural
from room2dgs.captures.text_files import floats, lines_of
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.geometry.poses import inverse_pose, rigid_pose

LAYOUT = "<id>_frames/{lowres_wide,lowres_wide_intrinsics,lowres_wide.traj} (ARKitScenes)"
# photos, intrinsics and depth that go together, the finer ones first
STREAMS = (("vga_wide", "vga_wide_intrinsics"), ("lowres_wide", "lowres_wide_intrinsics"))
DEPTHS = ("lowres_depth",)
SAME_PINCAM_S, SAME_POSE_S = 0.0015, 0.0055


def is_arkitscenes(files: Listing) -> bool:
    if "lowres_wide.traj" in files:
        return True
    return any(f"{name}/lowres_wide.traj" in files for name in files.matching("*_frames"))


def read_arkitscenes(root: Path, config: SceneConfig) -> Capture:
    """Read a scan.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    folder = root
    if not (root / "lowres_wide.traj").is_file():
        found = [root / name for name in Listing(root).matching("*_frames")]
        if len(found) != 1:
            raise InputError(f"{root} has {len(found)} folders *_frames; a scan in this layout has {LAYOUT}")
        folder = found[0]
    stream = next((pair for pair in STREAMS if (folder / pair[0]).is_dir()), STREAMS[-1])
    stamps, poses = _trajectory(folder / "lowres_wide.traj")
    pincams = sorted((_stamp(name), name) for name in listed(folder / stream[1]) if name.endswith(".pincam"))
    if not pincams:
        raise InputError(f"{folder / stream[1]} has no .pincam; download the scan again")
    pincam_stamps = np.array([stamp for stamp, _ in pincams])
    depth_names = listed(folder / DEPTHS[0])
    lenses: dict[str, object] = {}
    shots = []
    for name in natural(name for name in listed(folder / stream[0]) if name.endswith(".png")):
        stamp = _stamp(name)
        nearest = int(np.argmin(np.abs(pincam_stamps - stamp)))
        at = int(np.argmin(np.abs(stamps - stamp)))
        pincam = pincams[nearest][1]
        if pincam not in lenses:
            lenses[pincam] = _lens(folder / stream[1] / pincam, config)
        near = abs(pincam_stamps[nearest] - stamp) <= SAME_PINCAM_S and abs(stamps[at] - stamp) <= SAME_POSE_S
        depth = depth_file(folder / DEPTHS[0] / name) if name in depth_names else None
        shots.append(Shot(name, folder / stream[0] / name, poses[at] if near else _lost, lenses[pincam], depth=depth))
    mesh = gt_mesh_in(folder) or gt_mesh_in(folder.parent, "*_3dod_mesh.ply", own=False)
    return Capture(root, "arkitscenes", shots, gt_mesh=mesh, why="ARKit's poses are metres")


def _lost() -> np.ndarray:
    raise Lost("no pose or intrinsics near its time")


def _stamp(name: str) -> float:
    """Seconds in <id>_<seconds>.<suffix>."""
    text = name.rpartition(".")[0].rpartition("_")[2]
    return floats(text, name, None, 1)[0]


def _lens(path: Path, config: SceneConfig):
    lines = lines_of(path)
    width, height, *values = floats(lines[0][1] if lines else "", path, 1, 6)
    if not (0 < width < 65536 and 0 < height < 65536):
        raise InputError(f"{path} has no size of a photo; download the scan again")
    return pinhole_lens(*values, (int(width), int(height)), path, config.pixel_centres != "integer")


def _trajectory(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(N,) seconds and (N, 4, 4) camera-to-world."""
    from scipy.spatial.transform import Rotation

    rows = np.array([floats(text, path, line, 7) for line, text in lines_of(path)]).reshape(-1, 7)
    rows = rows[np.isfinite(rows).all(axis=1) & (np.abs(rows) < 1e12).all(axis=1)]
    if not len(rows):
        raise InputError(f"{path} has no poses; download the scan again")
    rotations = Rotation.from_rotvec(rows[:, 1:4]).as_matrix()
    poses = [inverse_pose(rigid_pose(rotation, t)) for rotation, t in zip(rotations, rows[:, 4:], strict=True)]
    return rows[:, 0], np.stack(poses)
