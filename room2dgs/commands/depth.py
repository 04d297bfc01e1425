"""`room2dgs depth`: dense depth of a capture's photos by stereo, and a first mesh without any training."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.stages import cached, read, refined, use_threads
from room2dgs.files import whole_file
from room2dgs.logs import run_log
from room2dgs.runs.folder import MESH, POINTS, claimed, new_run
from room2dgs.runs.metrics import record, timed

if TYPE_CHECKING:
    from room2dgs.geometry.camera import Camera
    from room2dgs.mesh.views import FusedView
    from room2dgs.stereo.dense import DenseView

USAGE = "room2dgs depth scene.path=DIR out=DIR [stereo.KEY=VALUE ...] [mesh.KEY=VALUE ...]"
CLOUD = "dense.ply"
MAPS = ("depth", "normal", "error", "agreeing")


def main(argv: list[str]) -> int:
    """Compare the photos with each other: depth, normals, expected errors and agreeing views of each, a coloured
    point cloud (dense.ply), and a mesh of the depth alone (mesh.ply).

    The maps are .npy files named as the photos: depth in metres (0 = none), unit normals in the world frame, errors in
    metres. `room2dgs run ... prior/depth=files prior.depth.path=OUT/depth prior.depth.align=false` trains with them.
    """
    if asked_for_help(argv):
        return show(USAGE, main.__doc__, ("scene", "points", "stereo", "mesh"))
    config = new_run(argv)
    seconds: dict[str, float] = {}
    with timed(seconds, "read"):
        scene = read(config, keep=True)
    with claimed(config) as out, cached(scene, out):
        from room2dgs.mesh.fuse import fuse
        from room2dgs.mesh.io import write_mesh
        from room2dgs.sfm.sparse import sparse_points
        from room2dgs.stereo.cloud import fused_cloud, ply_bytes
        from room2dgs.stereo.scene import coverage, scene_stereo

        log = run_log(out)
        use_threads(config)
        scene = refined(scene, config, out, log, seconds)
        with timed(seconds, "points"):
            points = sparse_points(scene, config.points, Path(config.points.cache or out / POINTS), log)
        with timed(seconds, "stereo"):
            cameras, found = scene_stereo(scene.train, points, config.stereo, log, config.render.device)
            views = list(found)
        share = coverage(views)
        log(
            f"stereo: {share.mean():.0%} of the pixels of {len(views)} views have a depth (least {share.min():.0%}), "
            f"{seconds['stereo'] / len(views):.1f} s a view"
        )
        with timed(seconds, "write"):
            _write_maps(out, scene.train, views)
            pixels = (
                (camera, view.depth, view.normal, color)
                for camera, view, color in zip(cameras, views, _colors(scene.train, cameras), strict=True)
            )
            cloud = fused_cloud(pixels, config.stereo.cell_m)
            with whole_file(out / CLOUD) as temporary:
                temporary.write_bytes(ply_bytes(cloud))
        log(f"points: {out / CLOUD}, {len(cloud.xyz):,}")
        part = {"stereo_coverage": round(float(share.mean()), 4), "dense_points": len(cloud.xyz)}
        if share.any():
            with timed(seconds, "mesh"):
                mesh = fuse(_fused_views(scene.train, cameras, views), config.mesh, log)
                write_mesh(out / MESH, mesh)
            log(f"mesh: {out / MESH}")
        record(out, part, seconds)
    return 0


def _write_maps(out: Path, frames: tuple[Frame, ...], views: list[DenseView]) -> None:
    for name in MAPS:
        (out / name).mkdir(exist_ok=True)
        for frame, view in zip(frames, views, strict=True):
            buffer = io.BytesIO()
            np.save(buffer, getattr(view, name))
            with whole_file(out / name / f"{frame.color_path.stem}.npy") as temporary:
                temporary.write_bytes(buffer.getvalue())


def _colors(frames: tuple[Frame, ...], cameras: list[Camera]) -> Iterator[np.ndarray]:
    import cv2

    for frame, camera in zip(frames, cameras, strict=True):
        yield cv2.resize(frame.color(), camera.size, interpolation=cv2.INTER_AREA)


def _fused_views(frames: tuple[Frame, ...], cameras: list[Camera], views: list[DenseView]) -> Iterator[FusedView]:
    from room2dgs.mesh.views import FusedView

    for camera, view, color in zip(cameras, views, _colors(frames, cameras), strict=True):
        yield FusedView(camera, view.depth, color)
