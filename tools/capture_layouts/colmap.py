"""COLMAP models, as text and binary."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from room2dgs.tools.capture_layouts.made import Made, photo_file, text, wxyz


def colmap_names(count: int) -> list[str]:
    """With a folder, a space, and numbers that sort otherwise as text."""
    return [f"walk one/IMG_{i + 7}.jpg" for i in range(count)]


def colmap_text(folder: Path, made: Made, names: list[str], camera: str, poses=None) -> None:
    """cameras.txt, images.txt with two lines an image, points3D.txt."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cameras.txt").write_text(f"# Camera list\n3 {camera}\n")
    lines = ["# Image list with two lines of data per image:"]
    tracks: dict[int, list[str]] = {}
    for i, pose in enumerate(made.poses if poses is None else poses):
        cam_from_world = np.linalg.inv(pose)
        lines.append(f"{i + 10} {text(wxyz(cam_from_world[:3, :3]))} {text(cam_from_world[:3, 3])} 3 {names[i]}")
        index, pixel = made.seen[i]
        features = ["1.5 2.5 -1"]
        for feature, (point, (x, y)) in enumerate(zip(index, pixel, strict=True), start=1):
            features.append(f"{x:.9f} {y:.9f} {point + 100}")
            tracks.setdefault(point, []).append(f"{i + 10} {feature}")
        lines.append(" ".join(features))
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    points = [
        f"{point + 100} {text(made.xyz[point])} {' '.join(map(str, made.rgb[point]))} 0.3 {' '.join(track)}"
        for point, track in tracks.items()
    ]
    (folder / "points3D.txt").write_text("# 3D point list\n" + "\n".join(points) + "\n")


def pinhole_camera(made: Made) -> str:
    """The line of cameras.txt without its id."""
    return f"PINHOLE {made.width} {made.height} {text(made.fx_fy_cx_cy)}"


def colmap(root: Path, made: Made) -> None:
    """Photos in a folder of images/, the model as text."""
    names = colmap_names(made.count)
    for i, name in enumerate(names):
        photo_file(root / "images" / name, made, i)
    colmap_text(root / "sparse/0", made, names, pinhole_camera(made))


def colmap_binary(root: Path, made: Made) -> None:
    """The same as u64 counts and little-endian records."""
    names = colmap_names(made.count)
    folder = root / "sparse"
    folder.mkdir(parents=True)
    for i, name in enumerate(names):
        photo_file(root / "images" / name, made, i)
    (folder / "cameras.bin").write_bytes(struct.pack("<QIiQQ4d", 1, 3, 1, made.width, made.height, *made.fx_fy_cx_cy))
    images = [struct.pack("<Q", made.count)]
    tracks: dict[int, list[tuple[int, int]]] = {}
    for i, pose in enumerate(made.poses):
        cam_from_world = np.linalg.inv(pose)
        images.append(struct.pack("<I7dI", i + 10, *wxyz(cam_from_world[:3, :3]), *cam_from_world[:3, 3], 3))
        images.append(names[i].encode() + b"\0")
        index, pixel = made.seen[i]
        images.append(struct.pack("<Q", len(index) + 1) + struct.pack("<ddQ", 1.5, 2.5, 2**64 - 1))
        for feature, (point, (x, y)) in enumerate(zip(index, pixel, strict=True), start=1):
            images.append(struct.pack("<ddQ", x, y, point + 100))
            tracks.setdefault(int(point), []).append((i + 10, feature))
    (folder / "images.bin").write_bytes(b"".join(images))
    points = [struct.pack("<Q", len(tracks))]
    for point, track in tracks.items():
        points.append(struct.pack("<Q3d3BdQ", point + 100, *made.xyz[point], *made.rgb[point], 0.3, len(track)))
        points += [struct.pack("<II", *element) for element in track]
    (folder / "points3D.bin").write_bytes(b"".join(points))
