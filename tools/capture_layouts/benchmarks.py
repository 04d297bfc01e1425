"""RGB-D benchmarks: Replica, TUM, 7-Scenes, Neural RGB-D, MonoSDF, SDFStudio, Open3D."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from room2dgs.tools.capture_layouts.made import GL, Made, image_file, lists, photo_file, rows, text, wxyz


def replica(root: Path, made: Made) -> None:
    """traj.txt of 16 numbers a line; cam_params.json beside the scenes; its scale is units of depth a metre."""
    root.mkdir(parents=True)
    (root / "traj.txt").write_text("\n".join(text(pose) for pose in made.poses) + "\n")
    camera = dict(zip(("fx", "fy", "cx", "cy"), made.counted_at_integers, strict=True))
    camera |= {"w": made.width, "h": made.height, "scale": 1000.0}
    (root.parent / "cam_params.json").write_text(json.dumps({"camera": camera}))
    for i in range(made.count):
        photo_file(root / f"results/frame{i:06d}.jpg", made, i)
        image_file(root / f"results/depth{i:06d}.png", made.depths[i])


def tum(root: Path, made: Made) -> None:
    """Lists with times; depth of 5000 a metre."""
    root.mkdir(parents=True)
    rgb, depth, truth = ["# color images"], ["# depth maps"], ["# timestamp tx ty tz qx qy qz qw"]
    for i, pose in enumerate(made.poses):
        stamp = 1305031102.175304 + 0.5 * i
        photo_file(root / f"rgb/{stamp:.6f}.png", made, i)
        image_file(root / f"depth/{stamp + 0.01:.6f}.png", 5 * made.depths[i])
        rgb.append(f"{stamp:.6f} rgb/{stamp:.6f}.png")
        depth.append(f"{stamp + 0.01:.6f} depth/{stamp + 0.01:.6f}.png")
        w, x, y, z = wxyz(pose[:3, :3])
        truth.append(f"{stamp:.6f} {text(pose[:3, 3])} {text([x, y, z, w])}")
    (root / "rgb.txt").write_text("\n".join(rgb))
    (root / "depth.txt").write_text("\n".join(depth))
    (root / "groundtruth.txt").write_text("\n".join(truth))


def sevenscenes(root: Path, made: Made) -> None:
    """Three frames a sequence; tabs in the poses."""
    for i, pose in enumerate(made.poses):
        folder = root / f"seq-{1 + i // 3:02d}"
        photo_file(folder / f"frame-{i:06d}.color.png", made, i)
        lines = ("\t ".join(f"{value:.17g}" for value in row) for row in pose)
        (folder / f"frame-{i:06d}.pose.txt").write_text("\t\n".join(lines))


def neuralrgbd(root: Path, made: Made) -> None:
    """Four lines a pose, OpenGL axes."""
    (root / "images").mkdir(parents=True)
    (root / "poses.txt").write_text("".join(rows(pose @ GL) for pose in made.poses))
    for i in range(made.count):
        photo_file(root / f"images/img{i + 8}.png", made, i)
        image_file(root / f"depth/depth{i + 8}.png", made.depths[i])


def monosdf(root: Path, made: Made) -> None:
    """world_mat = K times world-to-camera; scale_mat leads to another frame."""
    root.mkdir(parents=True)
    arrays: dict[str, np.ndarray] = {}
    for i, pose in enumerate(made.poses):
        photo_file(root / f"{i:06d}_rgb.png", made, i)
        arrays |= {
            f"world_mat_{i}": made.K_at_integers @ np.linalg.inv(pose),
            f"scale_mat_{i}": np.diag([2.5, 2.5, 2.5, 1.0]),
        }
    np.savez(root / "cameras.npz", allow_pickle=True, **arrays)


def sdfstudio(root: Path, made: Made) -> None:
    """Normalised: the metric world is worldtogt times it."""
    root.mkdir(parents=True)
    to_truth = np.diag([2.5, 2.5, 2.5, 1.0])
    to_truth[:3, 3] = [0.3, -0.2, 0.1]
    frames = []
    for i, pose in enumerate(made.poses):
        photo_file(root / f"{i:06d}_rgb.png", made, i)
        normalised = pose.copy()
        normalised[:3, 3] = (pose[:3, 3] - to_truth[:3, 3]) / 2.5
        K = lists(made.K_at_integers)
        frames.append({"rgb_path": f"{i:06d}_rgb.png", "camtoworld": lists(normalised), "intrinsics": K})
    meta = {"camera_model": "OPENCV", "height": made.height, "width": made.width, "worldtogt": lists(to_truth)}
    (root / "meta_data.json").write_text(json.dumps({**meta, "frames": frames}))


def open3d(root: Path, made: Made) -> None:
    """Five lines a frame."""
    (root / "scene").mkdir(parents=True)
    blocks = []
    for i, pose in enumerate(made.poses):
        photo_file(root / f"color/{i:05d}.jpg", made, i)
        image_file(root / f"depth/{i:05d}.png", made.depths[i])
        blocks.append(f"{i} {i} {i + 1}\n{rows(pose)}")
    (root / "scene/trajectory.log").write_text("".join(blocks))
