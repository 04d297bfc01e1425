"""Merges models of one capture that share photos or points."""

from __future__ import annotations

from pathlib import Path

from room2dgs.colmap import ONE_THREAD, pycolmap
from room2dgs.files import whole_folder
from room2dgs.logs import Log
from room2dgs.prepare.bridge import bridged
from room2dgs.prepare.mapping import names_of
from room2dgs.sfm.matching import quiet

LEAST_COMMON = 3  # photos in both
MAX_ERROR_PX = 8.0
LEAST_INLIERS = 0.3


def merged(
    models: list[pycolmap.Reconstruction], database: Path, images: Path, work: Path, known_camera: bool, log: Log
) -> tuple[pycolmap.Reconstruction, list[pycolmap.Reconstruction]]:
    """The largest model merged with those that share points with it, adjusted as one; and the others.

    Args:
        models: largest first.
        work: a folder for pycolmap's files.
        known_camera: the intrinsics stay as they are.
    """
    base, *left = models
    while True:
        others, left = left, []
        for other in others:
            new = names_of(other) - names_of(base)
            if not new:
                continue
            base_from_other, how = _between(base, other, database)
            if base_from_other is None:
                left.append(other)
                continue
            log(f"two models share {how}: {len(new)} photos join the larger one")
            base = _united(base, other, base_from_other, database, images, work, known_camera)
        if len(left) == len(others) or not left:
            return base, left


def _between(
    base: pycolmap.Reconstruction, other: pycolmap.Reconstruction, database: Path
) -> tuple[pycolmap.Sim3d | None, str]:
    """base_from_other, and how it was found."""
    common = names_of(base) & names_of(other)
    if len(common) >= LEAST_COMMON:
        with quiet():
            found = pycolmap.align_reconstructions_via_reprojections(other, base, LEAST_INLIERS, MAX_ERROR_PX)
        if found is not None:
            return found, f"{len(common)} photos"
    return bridged(base, other, database), "points that matches between their photos name"


def _united(
    base: pycolmap.Reconstruction,
    other: pycolmap.Reconstruction,
    base_from_other: pycolmap.Sim3d,
    database: Path,
    images: Path,
    work: Path,
    known_camera: bool,
) -> pycolmap.Reconstruction:
    """All poses in the base's frame, points triangulated anew, and one bundle adjustment of everything."""
    moved = pycolmap.Reconstruction(other)
    moved.transform(base_from_other)
    union = pycolmap.Reconstruction()
    for model in (base, moved):
        for camera_id, camera in sorted(model.cameras.items()):
            if not union.exists_camera(camera_id):
                union.add_camera_with_trivial_rig(camera)
        for image_id in sorted(model.reg_image_ids()):
            if union.exists_image(image_id):
                continue
            image = model.image(image_id)
            union.add_image_with_trivial_frame(
                pycolmap.Image(name=image.name, camera_id=image.camera_id, image_id=image_id), image.cam_from_world()
            )
    options = pycolmap.IncrementalPipelineOptions()
    options.ba_min_num_residuals_for_cpu_multi_threading = ONE_THREAD
    options.random_seed = options.triangulation.random_seed = 0
    with quiet(), whole_folder(work / "merged") as partial:
        union = pycolmap.triangulate_points(union, database, images, partial, options=options)
        adjustment = pycolmap.BundleAdjustmentOptions()
        adjustment.refine_focal_length = adjustment.refine_extra_params = not known_camera
        adjustment.ceres.min_num_residuals_for_cpu_multi_threading = ONE_THREAD
        pycolmap.bundle_adjustment(union, adjustment)
        union.update_point_3d_errors()
    return union
