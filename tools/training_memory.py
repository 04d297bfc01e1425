"""The peak memory of training over the number of views.

    python -m room2dgs.tools.training_memory --views 100,300,500

Makes a box room with a few distinct photos and prior maps, repeats them by links at poses millimetres apart, and runs
`room2dgs train` on them in a process of its own, an iteration a view.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import trimesh
from rich.console import Console
from rich.table import Table

from room2dgs.errors import InputError
from room2dgs.tools.command_line import command_line

DISTINCT = 10
ROOM = np.array([4.0, 5.0, 2.6])  # metres, one corner at the origin
JITTER_M = 0.003
SETTINGS = (
    "points.source=file",
    "prior=files",
    "scene.test_every=0",
    "seeds.voxel_m=0.1",
    "train.test_every=0",
    "train.tensorboard=false",
    # everything that keeps something of each view takes part
    "loss.multiview_photometric.start=1",
    "loss.multiview.min_baseline_m=0.001",
)


def make_capture(folder: Path, views: int, width: int, height: int) -> Path:
    """A capture in ScanNet's layout with depth/ and normal/ priors of every photo in priors/, and points.ply.

    Args:
        folder: made; takes DISTINCT photos and maps, whatever `views` is.
    """
    parts = ("color", "pose", "intrinsic", "priors/depth", "priors/normal")
    for name in (*parts, "kept"):
        (folder / name).mkdir(parents=True)
    K = np.eye(4)
    K[0, 0] = K[1, 1] = 0.8 * width
    K[0, 2], K[1, 2] = (width - 1) / 2, (height - 1) / 2
    np.savetxt(folder / "intrinsic" / "intrinsic_color.txt", K)
    random = np.random.default_rng(0)
    points = []
    for index in range(min(DISTINCT, views)):
        points.append(_write_view(folder / "kept", index, K, width, height, random))
    xyz = np.concatenate(points)
    trimesh.PointCloud(xyz, colors=np.full((len(xyz), 3), 128, np.uint8)).export(folder / "points.ply")
    for view in range(views):
        kept = view % DISTINCT
        pose = _pose(kept)
        pose[:3, 3] += JITTER_M * random.uniform(-1, 1, 3)
        np.savetxt(folder / "pose" / f"{view}.txt", pose)
        for name, suffix in (("color", "jpg"), ("priors/depth", "png"), ("priors/normal", "png")):
            os.link(folder / "kept" / f"{kept}_{Path(name).name}.{suffix}", folder / name / f"{view}.{suffix}")
    return folder


def peak_mb(capture: Path, out: Path, views: int, overrides: list[str]) -> dict[str, float]:
    """Train once over all views; the run's peak memory and seconds.

    Raises:
        InputError: the run failed; its last lines are in the sentence.
    """
    maps = [f"prior.{kind}.path={capture / 'priors' / kind}" for kind in ("depth", "normal")]
    settings = [*SETTINGS, f"points.file={capture / 'points.ply'}", *maps, f"train.iterations={views}", *overrides]
    command = [sys.executable, "-m", "room2dgs.cli", "train", f"scene.path={capture}", f"out={out}", *settings]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode:
        raise InputError(f"training on {views} views failed: {(done.stderr or done.stdout).strip()[-2000:]}")
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    seconds, stages = metrics["seconds"], metrics["training_seconds"]
    data_ms = 1000 * stages["data"] / views
    return {"peak_mb": metrics["peak_memory_mb"], "seconds": sum(seconds.values()), "data_ms": data_ms}


@command_line("training_memory")
def main(argv: list[str]) -> int:
    """Measure and print a table; KEY=VALUE arguments are settings of the runs."""
    parser = argparse.ArgumentParser(
        prog="training_memory", description="Peak memory of training over the number of views."
    )
    parser.add_argument("--views", default="100,300,500", help="numbers of views, with commas between")
    parser.add_argument("--size", default="1296x968", help="of the photos")
    parser.add_argument("--work", type=Path, help="folder for captures and runs; each is deleted after its run")
    parser.add_argument("settings", nargs="*", metavar="KEY=VALUE")
    args = parser.parse_args(argv)
    try:
        counts = [int(text) for text in args.views.split(",")]
        width, height = (int(text) for text in args.size.split("x"))
    except ValueError as error:
        raise InputError("--views takes numbers such as 100,300 and --size takes 1296x968") from error
    table = Table(title=f"Peak memory of training at {args.size}, an iteration a view")
    for column in ("views", "peak MB", "seconds", "data ms an iteration"):
        table.add_column(column, justify="right")
    for views in counts:
        with tempfile.TemporaryDirectory(prefix="memory-", dir=args.work) as work:
            capture = make_capture(Path(work) / "capture", views, width, height)
            found = peak_mb(capture, Path(work) / "run", views, args.settings)
        table.add_row(str(views), f"{found['peak_mb']:.0f}", f"{found['seconds']:.0f}", f"{found['data_ms']:.1f}")
        print(f"{views} views: {found}", flush=True)
    Console().print(table)
    return 0


def _pose(index: int) -> np.ndarray:
    """(4, 4) world_from_cam: standing in the room, turned by a tenth of a circle a photo, a step apart."""
    yaw = 2 * np.pi * index / DISTINCT
    forward = np.array([np.cos(yaw), np.sin(yaw), -0.2])
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = ROOM / 2 + 0.3 * np.array([np.cos(yaw), np.sin(yaw), 0.0])
    return pose


def _write_view(
    folder: Path, index: int, K: np.ndarray, width: int, height: int, random: np.random.Generator
) -> np.ndarray:
    """Photo, depth (mm) and normals (8 bits) of one pose; (M, 3) points on the walls that it sees."""
    pose = _pose(index)
    x, y = np.meshgrid((np.arange(width) - K[0, 2]) / K[0, 0], (np.arange(height) - K[1, 2]) / K[1, 1])
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ pose[:3, :3].T
    with np.errstate(divide="ignore"):
        distance = (np.where(rays > 0, ROOM, 0.0) - pose[:3, 3]) / rays
    wall = distance.argmin(axis=-1)
    depth = distance.min(axis=-1)
    normal = np.zeros_like(rays)
    facing = -np.sign(np.take_along_axis(rays, wall[..., None], axis=-1))
    np.put_along_axis(normal, wall[..., None], facing, axis=-1)
    points = pose[:3, 3] + depth[..., None] * rays
    light = 128 + 60 * np.sin(7 * points[..., 0]) * np.cos(5 * points[..., 1]) + 40 * np.sin(23 * points.sum(axis=-1))
    photo = np.stack([light, 255 - light, 0.5 * light], axis=-1).clip(0, 255).astype(np.uint8)
    cv2.imwrite(str(folder / f"{index}_color.jpg"), photo)
    cv2.imwrite(str(folder / f"{index}_depth.png"), np.round(1000 * depth).astype(np.uint16))
    in_cam = normal @ pose[:3, :3]
    cv2.imwrite(str(folder / f"{index}_normal.png"), np.round(127.5 * (in_cam + 1)).astype(np.uint8)[..., ::-1])
    row, column = random.integers(0, height, 1500), random.integers(0, width, 1500)
    return points[row, column]


if __name__ == "__main__":
    sys.exit(main())
