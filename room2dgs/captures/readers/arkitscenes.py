"""ARKitScenes: <id>_frames/{lowres_wide,lowres_depth,lowres_wide_intrinsics,lowres_wide.traj}, <id>_3dod_mesh.ply.

The trajectory is world-to-camera (axis times angle, metres) with OpenCV axes, world z up. Each photo has a .pincam near
its time. Depth is millimetres.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from room2dgs.captures.capture import Capture, Shot, damaged, lost, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.left_out import left_out
from room2dgs.captures.lens import Lens
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, natural
from room2dgs.captures.reader import Reader
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
    stamps, poses, pose_notes = _trajectory(folder / "lowres_wide.traj")
    pincams, notes = _stamped(folder / stream[1], ".pincam")
    if not pincams:
        raise InputError(f"{folder / stream[1]} has no .pincam; download the scan again")
    pincam_stamps = np.array([stamp for stamp, _ in pincams])
    photos, photo_notes = _stamped(folder / stream[0], ".png")
    depths, _ = _stamped(folder / DEPTHS[0], ".png")
    depth_stamps = np.array([stamp for stamp, _ in depths])
    lenses: dict[str, Lens | InputError] = {}
    shots = []
    for stamp, name in photos:
        nearest, at = _near(stamp, pincam_stamps), _near(stamp, stamps)
        pose: np.ndarray | Callable[[], np.ndarray] = poses[at]
        lens, pincam = None, pincams[nearest][1]
        if abs(pincam_stamps[nearest] - stamp) > SAME_PINCAM_S:
            pose = lost("no intrinsics near its time")
        else:
            if pincam not in lenses:
                lenses[pincam] = _lens(folder / stream[1] / pincam, config)
            known = lenses[pincam]
            if isinstance(known, InputError):
                pose = damaged(known)
            else:
                lens = known
        if abs(stamps[at] - stamp) > SAME_POSE_S:
            pose = lost("no pose near its time")
        depth = None
        if depths:
            nearest = _near(stamp, depth_stamps)
            if abs(depth_stamps[nearest] - stamp) <= SAME_PINCAM_S:
                depth = depth_file(folder / DEPTHS[0] / depths[nearest][1])
        shots.append(Shot(name, folder / stream[0] / name, pose, lens, depth=depth))
    mesh = gt_mesh_in(folder) or gt_mesh_in(folder.parent, "*_3dod_mesh.ply", own=False)
    notes = [*pose_notes, *notes, *photo_notes]
    return Capture(root, "arkitscenes", shots, gt_mesh=mesh, why="ARKit's poses are metres", notes=notes)


def _near(stamp: float, stamps: np.ndarray) -> int:
    return int(np.argmin(np.abs(stamps - stamp)))


def _stamped(folder: Path, suffix: str) -> tuple[list[tuple[float, str]], list[str]]:
    """(seconds, name) of the files <id>_<seconds>.<suffix>, in order of time; and a note on those of other names."""
    found, other = [], {}
    names = [name for name in listed(folder) if name.endswith(suffix)]
    for name in natural(names):
        try:
            found.append((floats(Path(name).stem.rpartition("_")[2], folder / name, None, 1)[0], name))
        except InputError as error:
            other[name] = str(error)
    message = left_out(other, len(names), f"files in {folder.name} without a time in their names")
    return sorted(entry for entry in found if np.isfinite(entry[0])), [message] if message else []


def _lens(path: Path, config: SceneConfig) -> Lens | InputError:
    """The lens, or why it is none: that costs the photos that it is for."""
    try:
        lines = lines_of(path)
        width, height, fx, fy, cx, cy = floats(lines[0][1] if lines else "", path, 1, 6)
        if not (0 < width < 65536 and 0 < height < 65536):
            raise InputError(f"{path} has no size of a photo; download the scan again")
        return pinhole_lens(fx, fy, cx, cy, (int(width), int(height)), path, config.pixel_centres != "integer")
    except InputError as error:
        return error


def _trajectory(path: Path) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """(N,) seconds and (N, 4, 4) camera-to-world, and notes on lines left out."""
    from scipy.spatial.transform import Rotation

    found, bad = [], {}
    lines = lines_of(path)
    for line, text in lines:
        try:
            found.append(floats(text, path, line, 7))
        except InputError as error:
            bad[f"line {line}"] = str(error)
    message = left_out(bad, len(lines), f"lines of {path.name}")
    rows = np.array(found).reshape(-1, 7)
    rows = rows[np.isfinite(rows).all(axis=1) & (np.abs(rows) < 1e12).all(axis=1)]
    if not len(rows):
        raise InputError(f"{path} has no poses; download the scan again")
    rotations = Rotation.from_rotvec(rows[:, 1:4]).as_matrix()
    poses = [inverse_pose(rigid_pose(rotation, t)) for rotation, t in zip(rotations, rows[:, 4:], strict=True)]
    return rows[:, 0], np.stack(poses), [message] if message else []


READER = Reader(is_arkitscenes, read_arkitscenes, LAYOUT)
