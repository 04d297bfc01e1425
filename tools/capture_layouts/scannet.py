"""ScanNet: exported folders and .sens."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from room2dgs.tools.capture_layouts.made import Made, image_file, photo_file, rows, text


def scannet(root: Path, made: Made, frames: str = "") -> None:
    """color/<i>.jpg, depth/<i>.png in mm, pose/<i>.txt; cx, cy count integers."""
    root = root / frames if frames else root
    for name in ("pose", "intrinsic"):
        (root / name).mkdir(parents=True)
    (root / "intrinsic/intrinsic_color.txt").write_text(rows(made.K_at_integers))
    (root / "intrinsic/intrinsic_depth.txt").write_text(rows(made.K_at_integers))
    for i, pose in enumerate(made.poses):
        photo_file(root / f"color/{2 * i}.jpg", made, i)
        image_file(root / f"depth/{2 * i}.png", made.depths[i])
        (root / f"pose/{2 * i}.txt").write_text(rows(pose))


def scannet_frames(root: Path, made: Made) -> None:
    """All under frames/."""
    scannet(root, made, "frames")


def scannet_flat(root: Path, made: Made) -> None:
    """What the C++ reader of .sens writes."""
    K = text(made.K_at_integers)
    root.mkdir(parents=True)
    (root / "_info.txt").write_text(
        "m_versionNumber = 4\nm_sensorName = StructureSensor\n"
        f"m_colorWidth = {made.width}\nm_colorHeight = {made.height}\n"
        f"m_depthWidth = {made.width}\nm_depthHeight = {made.height}\nm_depthShift = 1000\n"
        f"m_calibrationColorIntrinsic = {K}\nm_frames.size = {made.count}\n"
    )
    for i, pose in enumerate(made.poses):
        photo_file(root / f"frame-{i:06d}.color.jpg", made, i)
        image_file(root / f"frame-{i:06d}.depth.png", made.depths[i])
        (root / f"frame-{i:06d}.pose.txt").write_text(rows(pose))


def sens(root: Path, made: Made) -> None:
    """One file, little endian, version 4."""
    root.mkdir(parents=True)
    K = made.K_at_integers.astype("<f4")
    eye = np.eye(4, dtype="<f4")
    with (root / "scene0000_00.sens").open("wb") as file:
        file.write(struct.pack("<IQ", 4, 15) + b"StructureSensor")
        for values in (K, eye, K, eye):
            file.write(values.tobytes())
        file.write(struct.pack("<iiIIIIfQ", 2, 1, made.width, made.height, made.width, made.height, 1000.0, made.count))
        for i, pose in enumerate(made.poses):
            color = made.jpeg(i)
            depth = zlib.compress(made.depths[i].astype("<u2").tobytes())
            file.write(pose.astype("<f4").tobytes() + struct.pack("<4Q", 1000 * i, 1000 * i, len(color), len(depth)))
            file.write(color + depth)
        file.write(struct.pack("<Q", 0))
