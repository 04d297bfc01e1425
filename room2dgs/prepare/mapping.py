"""Poses and points from verified matches: incremental mapping by pycolmap, partial models merged."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from room2dgs.colmap import ONE_THREAD, pycolmap
from room2dgs.config import PrepareConfig
from room2dgs.cores import available_cores
from room2dgs.files import whole_folder
from room2dgs.logs import Log
from room2dgs.prepare.progress import Progress
from room2dgs.sfm.matching import quiet

SEED = 0
LEAST_MODEL = 5  # photos
# of the first pair, tried in turn: a video may have no two photos with COLMAP's 16 degrees between them
FIRST_ANGLES_DEG = (16.0, 6.0)


def mapped(
    database: Path, images: Path, count: int, config: PrepareConfig, known_camera: bool, work: Path, log: Log
) -> list[pycolmap.Reconstruction]:
    """Models of the photos, largest first; none if no two photos have parallax.

    Args:
        count: of the photos.
        known_camera: the intrinsics stay as they are.
        work: a folder for pycolmap's files.
    """
    for angle in FIRST_ANGLES_DEG:
        options = _options(config, known_camera, angle)
        progress = Progress(log, "mapping", count, "photos placed")
        log(f"mapping: {count} photos")
        seen = [2]

        def next_image(progress: Progress = progress, seen: list[int] = seen) -> None:
            seen[0] += 1
            progress.at(min(seen[0], count))

        with quiet(errors=False), whole_folder(work / "models") as partial:
            found = pycolmap.incremental_mapping(
                database, images, partial, options=options, next_image_callback=next_image
            )
        models = [model for _, model in sorted(found.items()) if model.num_reg_images() >= LEAST_MODEL]
        if models:
            return sorted(models, key=lambda model: -model.num_reg_images())
    return []


def _options(config: PrepareConfig, known_camera: bool, first_angle: float) -> pycolmap.IncrementalPipelineOptions:
    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = SEED
    options.mapper.random_seed = SEED
    options.triangulation.random_seed = SEED
    options.num_threads = config.threads or available_cores()
    options.ba_min_num_residuals_for_cpu_multi_threading = ONE_THREAD
    options.min_model_size = LEAST_MODEL
    options.mapper.init_min_tri_angle = first_angle
    if known_camera:
        options.ba_refine_focal_length = options.ba_refine_extra_params = False
        options.mapper.abs_pose_refine_focal_length = options.mapper.abs_pose_refine_extra_params = False
    return options


def triangulation_angles(model: pycolmap.Reconstruction) -> np.ndarray:
    """(P,) degrees, the widest angle under which two of its photos see each point."""
    centres = {i: model.image(i).projection_center() for i in model.reg_image_ids()}
    angles = []
    for point in model.points3D.values():
        rays = np.array([centres[element.image_id] for element in point.track.elements]) - point.xyz
        rays /= np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-12)
        angles.append(np.degrees(np.arccos(np.clip((rays @ rays.T).min(), -1, 1))))
    return np.array(angles)


def names_of(model: pycolmap.Reconstruction) -> set[str]:
    return {model.image(image_id).name for image_id in model.reg_image_ids()}


def in_order(models: Sequence[pycolmap.Reconstruction]) -> list[pycolmap.Reconstruction]:
    return sorted(models, key=lambda model: (-model.num_reg_images(), min(model.reg_image_ids())))
