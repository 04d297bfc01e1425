"""Scanners on phones: Polycam, Record3D, Stray Scanner, ARKitScenes."""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from room2dgs.tools.capture_layouts.made import GL, Made, image_file, photo_file, text, wxyz


def polycam(root: Path, made: Made) -> None:
    """t_<row><column>, OpenGL axes; depth in mm."""
    for i, pose in enumerate(made.poses):
        gl, name = pose @ GL, f"{40219379 + 1000 * i}"
        camera = {f"t_{row}{column}": gl[row, column] for row in range(3) for column in range(4)}
        camera |= dict(zip(("fx", "fy", "cx", "cy"), made.fx_fy_cx_cy, strict=True))
        camera |= {"width": made.width, "height": made.height, "blur_score": 90.0}
        photo_file(root / f"keyframes/corrected_images/{name}.jpg", made, i)
        image_file(root / f"keyframes/depth/{name}.png", made.depths[i])
        path = root / f"keyframes/corrected_cameras/{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(camera))


def polycam_zip(root: Path, made: Made) -> None:
    """The same in a zip that nests one folder."""
    polycam(root / "made", made)
    with zipfile.ZipFile(root / "capture.zip", "w") as archive:
        for path in sorted((root / "made").rglob("*.*")):
            archive.write(path, f"My room/{path.relative_to(root / 'made')}")
    shutil.rmtree(root / "made")


def record3d_meta(made: Made) -> dict:
    poses = []
    for pose in made.poses:
        w, x, y, z = wxyz((pose @ GL)[:3, :3])
        poses.append([float(value) for value in (x, y, z, w, *pose[:3, 3])])
    K = [float(value) for value in made.K.T.ravel()]
    return {"w": made.width, "h": made.height, "dw": made.width, "dh": made.height, "fps": 60, "K": K, "poses": poses}


def record3d(root: Path, made: Made) -> None:
    """The export with photos and metadata.json."""
    for i in range(made.count):
        photo_file(root / f"rgb/{i}.jpg", made, i)
    (root / "metadata.json").write_text(json.dumps(record3d_meta(made)))


def record3d_archive(root: Path, made: Made) -> None:
    """An .r3d: a zip; depth in metres, NaN = none, packed by LZFSE."""
    import liblzfse

    root.mkdir(parents=True)
    with zipfile.ZipFile(root / "room.r3d", "w") as archive:
        archive.writestr("metadata", json.dumps(record3d_meta(made)))
        for i in range(made.count):
            archive.writestr(f"rgbd/{i}.jpg", made.jpeg(i))
            metres = np.where(made.depths[i] > 0, made.depths[i] / 1000, np.nan).astype("<f4")
            archive.writestr(f"rgbd/{i}.depth", liblzfse.compress(metres.tobytes()))


def stray(root: Path, made: Made) -> None:
    """A video; columns by their names, OpenCV axes."""
    root.mkdir(parents=True)
    writer = cv2.VideoWriter(str(root / "rgb.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 30, (made.width, made.height))
    lines = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    for i, pose in enumerate(made.poses):
        writer.write(made.photos[i])
        image_file(root / f"depth/{i:06d}.png", made.depths[i])
        w, x, y, z = wxyz(pose[:3, :3])
        values = ", ".join(f"{value:.17g}" for value in (*pose[:3, 3], x, y, z, w))
        lines.append(f"{0.1 * i}, {i:06d}, {values}")
    writer.release()
    (root / "odometry.csv").write_text("\n".join(lines) + "\n")
    (root / "camera_matrix.csv").write_text("\n".join(", ".join(map(repr, row)) for row in made.K.tolist()))


def arkitscenes(root: Path, made: Made) -> None:
    """World-to-camera as axis times angle; names end in seconds."""
    folder = root / "41069021_frames"
    (folder / "lowres_wide_intrinsics").mkdir(parents=True)
    lines = []
    for i, pose in enumerate(made.poses):
        stamp = 6790.123 + 0.1 * i
        name = f"41069021_{stamp:.3f}"
        photo_file(folder / f"lowres_wide/{name}.png", made, i)
        image_file(folder / f"lowres_depth/{name}.png", made.depths[i])
        pincam = folder / f"lowres_wide_intrinsics/41069021_{stamp + 0.001:.3f}.pincam"
        pincam.write_text(f"{made.width} {made.height} {text(made.fx_fy_cx_cy)}")
        cam_from_world = np.linalg.inv(pose)
        turn = Rotation.from_matrix(cam_from_world[:3, :3]).as_rotvec()
        lines.append(f"{stamp + 0.002:.6f} {text(turn)} {text(cam_from_world[:3, 3])}")
    (folder / "lowres_wide.traj").write_text("\n".join(lines) + "\n")
    (root / "41069021_3dod_mesh.ply").write_text("ply\n")
