"""Sparse points by pycolmap from matches and known poses, which are constant."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.colmap import ONE_THREAD, pycolmap
from room2dgs.config import PointsConfig
from room2dgs.errors import InputError
from room2dgs.logs import Log
from room2dgs.sfm.contradiction import verdict
from room2dgs.sfm.matching import IndexPairs, Matches, epipolar_error, image_name, match, pinhole, quiet
from room2dgs.sfm.pairs import match_pairs
from room2dgs.sfm.readings import POSE_DESCRIPTIONS, better_focal, better_reading, intrinsics_setting

MAX_EPIPOLAR_PX = 2.0
MIN_PAIR_MATCHES = 15
# With true poses 70 to 98 % of the matches agree (measured), with poses of another convention 1 to 13 %.
MIN_INLIER_SHARE = 0.25
MIN_ANGLE_DEG = 1.5
DEPTH_RANGE_M = (0.05, 30.0)


def triangulate(frames: Sequence[Frame], config: PointsConfig, work: Path, log: Log) -> PointCloud:
    """Triangulate SIFT matches between posed photos, on the CPU.

    The result does not depend on the number of threads.

    Args:
        frames: the views to use, at their working size.
        work: an empty folder for images and database; the caller removes it.

    Returns:
        Points seen in at least `config.min_track` views with a mean reprojection error of at most
        `config.max_error_px`, in front of every camera that saw them, with their tracks; possibly none.

    Raises:
        InputError: the photos match, but not where the poses say.
    """
    pairs = match_pairs([frame.camera for frame in frames], config.overlap)
    log(f"points: matching {len(pairs)} pairs of {len(frames)} photos")
    return triangulate_matches(match(frames, pairs, config, work), frames, pairs, config, work / "model")


def triangulate_matches(
    matches: Matches, frames: Sequence[Frame], pairs: IndexPairs, config: PointsConfig, model: Path
) -> PointCloud:
    """`triangulate` for photos that are matched already.

    Args:
        frames: the first of `matches.frames`, with the poses that count.
        pairs: of them, in the order of `match_pairs`.
        model: where pycolmap puts its files.
    """
    with quiet():
        _verify(matches, frames, pairs)
        reconstruction = _triangulate(matches, frames, model)
    return _select(reconstruction, frames, matches.image_ids, config)


def _verify(matches: Matches, frames: Sequence[Frame], pairs: IndexPairs) -> None:
    """Keep the matches that lie on the epipolar lines of the known poses."""
    cameras = [frame.camera for frame in frames]
    total = kept = 0
    with pycolmap.Database.open(matches.database) as db:
        db.clear_two_view_geometries()
        for i, j in pairs:
            if (i, j) not in matches.of_pair:
                continue
            found = matches.of_pair[i, j]
            error = epipolar_error(cameras[i], cameras[j], *matches.pixels((i, j)))
            inliers = found[error <= MAX_EPIPOLAR_PX]
            total, kept = total + len(found), kept + len(inliers)
            if len(inliers) < MIN_PAIR_MATCHES:
                continue
            geometry = pycolmap.TwoViewGeometry()
            geometry.config = pycolmap.TwoViewGeometryConfiguration.CALIBRATED
            geometry.inlier_matches = inliers
            db.write_two_view_geometry(matches.image_ids[i], matches.image_ids[j], geometry)
    if total >= 1000 and kept < MIN_INLIER_SHARE * total:
        judged = verdict(matches, cameras, pairs)
        if judged.confirmed:  # it is the matches that are wrong
            return
        other = better_reading(matches, cameras, pairs, MAX_EPIPOLAR_PX)
        if other is not None:
            poses, share = other
            raise InputError(
                f"{matches.photos} and its poses do not belong together, only {100 * kept / total:.0f} % of {total} "
                f"matches agree; {100 * share:.0f} % do if these poses are {POSE_DESCRIPTIONS[poses]}: give "
                f"scene.poses={poses}"
            )
        zoom = better_focal(matches, cameras, pairs, MAX_EPIPOLAR_PX)
        if zoom is not None:
            factor, share = zoom
            raise InputError(
                f"{matches.photos} and its intrinsics do not belong together, only {100 * kept / total:.0f} % of "
                f"{total} matches agree; {100 * share:.0f} % do with a focal length {factor:.2f} times as long: give "
                f"{intrinsics_setting(frames[0], factor)}"
            )
        if not judged.contradicted:  # photos with so little in common say nothing of poses
            return
        raise InputError(
            f"{matches.photos} and its poses do not belong together, only {100 * kept / total:.0f} % of {total} "
            "matches agree; write poses as camera-to-world with x right, y down, z forward, and check "
            "the intrinsics"
        )


def _triangulate(matches: Matches, frames: Sequence[Frame], model: Path) -> pycolmap.Reconstruction:
    reconstruction = pycolmap.Reconstruction()
    with pycolmap.Database.open(matches.database) as db:
        number = [db.read_image(image_id).camera_id for image_id in matches.image_ids]
        known = {camera.camera_id: camera for camera in db.read_all_cameras()}
        for camera_id, frame in zip(number, frames, strict=False):  # focal lengths may be others since the matching
            known[camera_id] = pinhole(frame.camera)
            known[camera_id].camera_id = camera_id
        for camera in known.values():
            reconstruction.add_camera_with_trivial_rig(camera)
        for frame, image_id, camera_id in zip(frames, matches.image_ids, number, strict=False):
            reconstruction.add_image_with_trivial_frame(
                pycolmap.Image(name=image_name(frame), camera_id=camera_id, image_id=image_id),
                pycolmap.Rigid3d(frame.camera.cam_from_world[:3]),
            )
    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = 0
    options.ba_min_num_residuals_for_cpu_multi_threading = ONE_THREAD
    options.min_num_matches = MIN_PAIR_MATCHES
    options.triangulation.min_angle = MIN_ANGLE_DEG
    model.mkdir()
    return pycolmap.triangulate_points(reconstruction, matches.database, matches.images, model, options=options)


def _select(
    reconstruction: pycolmap.Reconstruction, frames: Sequence[Frame], image_ids: Sequence[int], config: PointsConfig
) -> PointCloud:
    """The points to keep, in the order of their ids.

    A track may hold two features of one photo: the one nearer to the point's projection counts.
    """
    points = [point for _, point in sorted(reconstruction.points3D.items())]
    xyz = np.array([point.xyz for point in points], np.float64).reshape(-1, 3)
    point, frame, pixel = _observations(reconstruction, points, frames, image_ids)
    error, depth = np.zeros(len(point)), np.zeros(len(point))
    for index in np.unique(frame):
        mine = frame == index
        projected, depth[mine] = frames[index].camera.project(xyz[point[mine]])
        error[mine] = np.linalg.norm(projected - pixel[mine], axis=-1)
    order = np.lexsort((error, frame, point))
    first = np.ones(len(order), bool)
    first[1:] = (np.diff(point[order]) != 0) | (np.diff(frame[order]) != 0)
    seen = order[first]
    views = np.bincount(point[seen], minlength=len(points))
    outside = ~((DEPTH_RANGE_M[0] < depth[seen]) & (depth[seen] < DEPTH_RANGE_M[1]))
    kept = (views >= config.min_track) & (np.bincount(point[seen][outside], minlength=len(points)) == 0)
    kept &= np.array([one.error <= config.max_error_px for one in points], bool)
    seen = seen[kept[point[seen]]]
    tracks = Tracks(
        tuple(frame.name for frame in frames),
        frame[seen].astype(np.int32),
        (np.cumsum(kept) - 1)[point[seen]].astype(np.int32),
        pixel[seen].astype(np.float32),
    )
    rgb = np.array([one.color for one in points], np.uint8).reshape(-1, 3)
    return PointCloud(xyz[kept], rgb[kept], tracks)


def _observations(
    reconstruction: pycolmap.Reconstruction,
    points: Sequence[pycolmap.Point3D],
    frames: Sequence[Frame],
    image_ids: Sequence[int],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All elements of all tracks: (O,) index of the point, (O,) of the frame, and (O, 2) pixel, with COLMAP's pixel
    centres, which are ours (+0.5)."""
    number = {image_id: index for index, image_id in enumerate(image_ids[: len(frames)])}
    listed = [
        (index, number[element.image_id], element.point2D_idx)
        for index, point in enumerate(points)
        for element in point.track.elements
    ]
    point, frame, feature = np.array(listed, np.int64).reshape(-1, 3).T
    pixel = np.zeros((len(listed), 2))
    for image_id, index in number.items():
        mine = np.flatnonzero(frame == index)
        if len(mine):
            image = reconstruction.image(image_id)
            pixel[mine] = [image.point2D(int(one)).xy for one in feature[mine]]
    return point, frame, pixel
