"""The prepared capture as a COLMAP project: undistorted photos, refined poses, sparse points with their tracks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.captures.world_offset import Origin, camera_in_world, xyz_in_world
from room2dgs.colmap import pycolmap
from room2dgs.export.photos import write_masks, write_photos
from room2dgs.export.source import Source
from room2dgs.files import whole_folder


def write_colmap(source: Source, folder: Path) -> list[Path]:
    """images/, masks/ if the photos have some, and sparse/0/ (cameras.bin, images.bin, points3D.bin)."""
    return _write(source, folder, pycolmap.Reconstruction.write_binary)


def write_colmap_text(source: Source, folder: Path) -> list[Path]:
    """The same as .txt."""
    return _write(source, folder, pycolmap.Reconstruction.write_text)


def _write(source: Source, folder: Path, write_model: Callable[[pycolmap.Reconstruction, Path], None]) -> list[Path]:
    names = write_photos(source.scene.frames, folder / "images")
    masks = write_masks(source.scene.frames, folder / "masks", names)
    model = folder / "sparse" / "0"
    model.parent.mkdir(parents=True, exist_ok=True)
    reconstruction = colmap_model(source.scene, source.points, names)
    with whole_folder(model) as partial:
        write_model(reconstruction, partial)
    pictures = [folder / "images" / name for name in names.values()]
    return [*pictures, *(folder / "masks" / name for name in masks.values()), *sorted(model.iterdir())]


def colmap_model(scene: Scene, points: PointCloud, names: dict[str, str]) -> pycolmap.Reconstruction:
    """Cameras, images and points; one PINHOLE camera for all views that share its numbers.

    Args:
        names: frame's name -> its photo's.
    """
    model = pycolmap.Reconstruction()
    cameras: dict[tuple, int] = {}
    ids: dict[str, int] = {}
    for number, frame in enumerate(scene.frames, start=1):
        K, size = frame.camera.K, frame.camera.size
        key = (*size, K[0, 0], K[1, 1], K[0, 2], K[1, 2])
        if key not in cameras:
            cameras[key] = len(cameras) + 1
            model.add_camera_with_trivial_rig(
                pycolmap.Camera(
                    camera_id=cameras[key], model="PINHOLE", width=size[0], height=size[1], params=list(key[2:])
                )
            )
        pixels = _pixels(points, frame.name)
        camera = camera_in_world(frame.camera, scene.origin_m)
        image = pycolmap.Image(
            name=names[frame.name], keypoints=pixels, camera_id=cameras[key], image_id=number
        )  # its features are the points that it saw, in their order
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(camera.cam_from_world[:3]))
        ids[frame.name] = number
    _add_points(model, points, ids, scene.origin_m)
    return model


def _pixels(points: PointCloud, name: str) -> np.ndarray:
    """(N, 2) float64 of the points that a photo saw."""
    return np.zeros((0, 2)) if points.tracks is None else points.tracks.of_frame(name)[1].astype(np.float64)


def _add_points(model: pycolmap.Reconstruction, points: PointCloud, ids: dict[str, int], origin_m: Origin) -> None:
    seen: list[list[tuple[int, int]]] = [[] for _ in range(len(points))]
    if points.tracks is not None:
        for name, number in ids.items():
            for feature, point in enumerate(points.tracks.of_frame(name)[0]):
                seen[point].append((number, feature))
    for xyz, rgb, track in zip(xyz_in_world(points.xyz, origin_m), points.rgb, seen, strict=True):
        elements = [pycolmap.TrackElement(image, feature) for image, feature in track]
        model.add_point3D(xyz, pycolmap.Track(elements), rgb)
    if points.tracks is not None:
        model.update_point_3d_errors()
