"""Dense stereo where depth is known: how much is found, how right it is, what it costs."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from room2dgs.captures.depth_at import depth_at
from room2dgs.captures.read import read_scene
from room2dgs.captures.scene import Frame
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.sfm.sparse import sparse_points
from room2dgs.splat import set_threads
from room2dgs.stereo.dense import DenseView
from room2dgs.stereo.scene import scene_stereo
from room2dgs.tools.stereo_check.speed import speed


def measured(config: Config, width: int | None) -> dict[str, object]:
    """One row: a capture's photos compared at a width.

    "scaling" is seconds on one thread by those on all threads, for some of the photos; "sweep / bare" is a sweep's time
    by that of the bare loop, see `stereo_speed`.

    Raises:
        InputError: the capture has no depth, or cannot be read.
    """
    scene = read_scene(config.scene)
    if not any(frame.depth_path for frame in scene.train):
        raise InputError(f"{scene.path} has no depth to measure against; add a depth folder")
    points = sparse_points(scene, config.points, Path(config.out) / "points", lambda line: None)
    threads = set_threads(config.render.threads)
    config.stereo.width = width
    wall, cpu = time.perf_counter(), time.process_time()
    cameras, found = scene_stereo(scene.train, points, config.stereo, lambda line: None)
    views = list(found)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    gained = speed(scene.train, points, config.stereo, cameras, views, threads)
    name = f"{scene.path.name} {cameras[0].width}x{cameras[0].height}"
    return {
        "scene": name,
        "photos": len(views),
        **scores(scene.train, cameras, views, config.mesh.max_depth_m),
        "seconds a photo": round(wall / len(views), 2),
        "CPU seconds": round(cpu / len(views), 2),
        "threads": threads,
        "scaling": round(gained.scaling, 2),
        "sweep / bare": round(gained.over_bare, 2),
    }


def scores(
    frames: Sequence[Frame], cameras: Sequence[Camera], views: Sequence[DenseView], max_depth_m: float
) -> dict[str, float]:
    """Of all pixels whose depth is known and at most `max_depth_m`.

    Returns:
        "kept": share with a depth; "2 cm", "5 cm": share of the kept ones that are so near; "AbsRel" and "median": mean
        and median relative error of the kept ones; "right": share of all within 5 cm; "expected / true": median of
        the expected error by the median of the true one.
    """
    known = kept = 0
    errors, relative, expected = [], [], []
    for frame, camera, view in zip(frames, cameras, views, strict=True):
        truth = true_depth(frame, camera)
        there = (truth > 0) & (truth <= max_depth_m)
        both = there & (view.depth > 0)
        known += int(np.count_nonzero(there))
        kept += int(np.count_nonzero(both))
        errors.append(np.abs(view.depth[both] - truth[both]))
        relative.append(errors[-1] / truth[both])
        expected.append(view.error[both])
    off, share, guess = (np.concatenate(part) for part in (errors, relative, expected))
    if not len(off):
        return {"kept": 0.0}
    figures = {
        "kept": kept / known,
        "2 cm": np.mean(off < 0.02),
        "5 cm": np.mean(off < 0.05),
        "AbsRel": np.mean(share),
        "median": np.median(share),
        "right": np.count_nonzero(off < 0.05) / known,
        "expected / true": np.median(guess) / max(float(np.median(off)), 1e-9),
    }
    return {name: round(float(value), 4) for name, value in figures.items()}


def true_depth(frame: Frame, camera: Camera) -> np.ndarray:
    """(H, W) depth of a capture at a camera's pixels, metres; 0 = none."""
    depth = frame.depth()
    if depth is None:
        return np.zeros((camera.height, camera.width), np.float32)
    return depth_at(depth, camera.pixels() * (depth.shape[1], depth.shape[0]) / camera.size)
