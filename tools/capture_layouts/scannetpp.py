"""ScanNet++: DSLR and iPhone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from room2dgs.tools.capture_layouts.colmap import colmap_text, pinhole_camera
from room2dgs.tools.capture_layouts.made import GL, Made, image_file, lists, photo_file
from room2dgs.tools.capture_layouts.transforms import named_intrinsics

# World-to-scan of ScanNet++'s transforms.json: x, y, z -> y, x, -z.
SWAPPED = np.array([[0.0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])


def scannetpp_dslr(root: Path, made: Made) -> None:
    """The COLMAP model, masks, and the release's own split."""
    names = [f"DSC{i + 98:05d}.JPG" for i in range(made.count)]
    folder = root / "dslr"
    for i, name in enumerate(names):
        photo_file(folder / "resized_images" / name, made, i)
        if made.mask is not None:
            image_file(folder / "resized_anon_masks" / f"{Path(name).stem}.png", made.mask)
    colmap_text(folder / "colmap", made, names, pinhole_camera(made))
    (folder / "train_test_lists.json").write_text(json.dumps({"train": names[1:], "test": names[:1]}))
    (root / "scans").mkdir()
    (root / "scans/mesh_aligned_0.05.ply").write_text("ply\n")


def scannetpp_json(root: Path, made: Made) -> None:
    """Without the COLMAP model: transforms.json alone."""
    folder = root / "dslr"
    frames = []
    for i, pose in enumerate(made.poses):
        photo_file(folder / f"resized_images/DSC{i + 98:05d}.JPG", made, i)
        frames.append({"file_path": f"DSC{i + 98:05d}.JPG", "transform_matrix": lists(SWAPPED @ pose @ GL)})
    meta = {**named_intrinsics(made), "w": made.width, "h": made.height, "camera_model": "PINHOLE"}
    (folder / "nerfstudio").mkdir()
    meta |= {"frames": frames[1:], "test_frames": frames[:1]}
    (folder / "nerfstudio/transforms.json").write_text(json.dumps(meta))
    (root / "scans").mkdir()


def scannetpp_iphone(root: Path, made: Made) -> None:
    folder = root / "iphone"
    """Frames as the toolkit takes them out of the video: every tenth."""
    names = [f"video/frame_{10 * i:06d}.jpg" for i in range(made.count)]
    colmap_text(folder / "colmap", made, names, pinhole_camera(made))
    (folder / "pose_intrinsic_imu.json").write_text("{}")
    for i in range(made.count):
        photo_file(folder / f"rgb/frame_{10 * i:06d}.jpg", made, i)
        image_file(folder / f"depth/frame_{10 * i:06d}.png", made.depths[i])
