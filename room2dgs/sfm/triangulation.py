"""Sparse points by pycolmap: features, matches, triangulation; the known poses never move."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.config import PointsConfig
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.logs import Log
from room2dgs.sfm.colmap import pycolmap
from room2dgs.sfm.pairs import match_pairs

# Looser than COLMAP's 0.8: the known poses sort out wrong matches. A tenth more points, no less exact.
MAX_RATIO = 0.9
MAX_EPIPOLAR_PX = 2.0
MIN_PAIR_MATCHES = 15
# With true poses 70 to 98 % of the matches agree (measured), with poses of another convention 1 to 13 %.
MIN_AGREEMENT = 0.25
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
    images, database = work / "images", work / "database.db"
    with _quiet():
        image_ids = _register(frames, images, database)
        _extract(images, database, config)
        pairs = match_pairs([frame.camera for frame in frames], config.overlap)
        log(f"points: matching {len(pairs)} pairs of {len(frames)} photos")
        _match(frames, pairs, database, work / "pairs.txt")
        _verify([frame.camera for frame in frames], image_ids, pairs, database, frames[0].color_path.parent)
        reconstruction = _triangulate(frames, image_ids, images, database, work / "model")
    return _select(reconstruction, frames, image_ids, config)


@contextmanager
def _quiet() -> Iterator[None]:
    """Only pycolmap's errors reach the terminal."""
    level = pycolmap.logging.minloglevel
    pycolmap.logging.minloglevel = int(pycolmap.logging.Level.ERROR)
    try:
        yield
    finally:
        pycolmap.logging.minloglevel = level


def _image_name(frame: Frame) -> str:
    return f"{frame.name}.png"


def _register(frames: Sequence[Frame], images: Path, database: Path) -> list[int]:
    """Write the working-size photos and enter them in order, so that ids do not depend on threads.

    Returns:
        The database's image id of each frame.
    """
    images.mkdir(parents=True)
    camera_ids: dict[bytes, int] = {}
    image_ids = []
    with pycolmap.Database.open(database) as db:
        for frame in frames:
            bgr = cv2.cvtColor(frame.color(), cv2.COLOR_RGB2BGR)
            path = images / _image_name(frame)
            if not cv2.imwrite(str(path), bgr, [cv2.IMWRITE_PNG_COMPRESSION, 1]):
                raise OSError(f"{path} cannot be written; is the disk full?")
            camera = _pinhole(frame.camera)
            key = camera.params.tobytes() + bytes(f"{camera.width}x{camera.height}", "ascii")
            if key not in camera_ids:
                camera_ids[key] = db.write_camera(camera)
                rig = pycolmap.Rig()
                rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, camera_ids[key]))
                db.write_rig(rig)
            image_ids.append(db.write_image(pycolmap.Image(name=path.name, camera_id=camera_ids[key])))
    return image_ids


def _pinhole(camera: Camera) -> pycolmap.Camera:
    K = camera.K
    return pycolmap.Camera(
        model="PINHOLE", width=camera.width, height=camera.height, params=[K[0, 0], K[1, 1], K[0, 2], K[1, 2]]
    )


def _extract(images: Path, database: Path, config: PointsConfig) -> None:
    options = pycolmap.FeatureExtractionOptions()
    options.sift.max_num_features = config.max_features
    options.sift.peak_threshold = config.peak_threshold
    pycolmap.extract_features(database, images, extraction_options=options, device=pycolmap.Device.cpu)


def _match(frames: Sequence[Frame], pairs: list[tuple[int, int]], database: Path, list_path: Path) -> None:
    lines = [f"{_image_name(frames[i])} {_image_name(frames[j])}" for i, j in pairs]
    list_path.write_text("\n".join(lines), encoding="utf-8")
    options = pycolmap.FeatureMatchingOptions()
    options.sift.max_ratio = MAX_RATIO
    options.skip_geometric_verification = True
    pycolmap.match_image_pairs(
        database,
        matching_options=options,
        pairing_options=pycolmap.ImportedPairingOptions(match_list_path=list_path),
        device=pycolmap.Device.cpu,
    )


def _verify(
    cameras: Sequence[Camera],
    image_ids: list[int],
    pairs: list[tuple[int, int]],
    database: Path,
    photos: Path,
) -> None:
    """Keep the matches that lie on the epipolar lines of the known poses."""
    total = kept = 0
    with pycolmap.Database.open(database) as db:
        db.clear_two_view_geometries()
        keypoints = [db.read_keypoints(image_id)[:, :2].astype(np.float64) for image_id in image_ids]
        for i, j in pairs:
            matches = db.read_matches(image_ids[i], image_ids[j])
            if len(matches) == 0:
                continue
            error = epipolar_error(cameras[i], cameras[j], keypoints[i][matches[:, 0]], keypoints[j][matches[:, 1]])
            inliers = matches[error <= MAX_EPIPOLAR_PX]
            total, kept = total + len(matches), kept + len(inliers)
            if len(inliers) < MIN_PAIR_MATCHES:
                continue
            geometry = pycolmap.TwoViewGeometry()
            geometry.config = pycolmap.TwoViewGeometryConfiguration.CALIBRATED
            geometry.inlier_matches = inliers
            db.write_two_view_geometry(image_ids[i], image_ids[j], geometry)
    if total >= 1000 and kept < MIN_AGREEMENT * total:
        raise InputError(
            f"{photos} and its poses do not belong together, only {100 * kept / total:.0f} % of {total} "
            "matches agree; write poses as camera-to-world with x right, y down, z forward, and check "
            "the intrinsics"
        )


def epipolar_error(first: Camera, second: Camera, first_px: np.ndarray, second_px: np.ndarray) -> np.ndarray:
    """Sampson distance of matched pixels from the epipolar geometry of two posed cameras.

    Args:
        first_px, second_px: (M, 2) matched pixels.

    Returns:
        (M,) float64, pixels.
    """
    second_from_first = second.cam_from_world @ first.world_from_cam
    essential = pycolmap.essential_matrix_from_pose(pycolmap.Rigid3d(second_from_first[:3]))
    fundamental = np.linalg.inv(second.K).T @ essential @ np.linalg.inv(first.K)
    return np.sqrt(pycolmap.compute_squared_sampson_error(first_px, second_px, fundamental))


def _triangulate(
    frames: Sequence[Frame], image_ids: list[int], images: Path, database: Path, model: Path
) -> pycolmap.Reconstruction:
    reconstruction = pycolmap.Reconstruction()
    with pycolmap.Database.open(database) as db:
        for camera in db.read_all_cameras():
            reconstruction.add_camera_with_trivial_rig(camera)
        for frame, image_id in zip(frames, image_ids, strict=True):
            camera_id = db.read_image(image_id).camera_id
            reconstruction.add_image_with_trivial_frame(
                pycolmap.Image(name=_image_name(frame), camera_id=camera_id, image_id=image_id),
                pycolmap.Rigid3d(frame.camera.cam_from_world[:3]),
            )
    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = 0
    options.min_num_matches = MIN_PAIR_MATCHES
    options.triangulation.min_angle = MIN_ANGLE_DEG
    model.mkdir()
    return pycolmap.triangulate_points(reconstruction, database, images, model, options=options)


def _select(
    reconstruction: pycolmap.Reconstruction, frames: Sequence[Frame], image_ids: list[int], config: PointsConfig
) -> PointCloud:
    number = {image_id: index for index, image_id in enumerate(image_ids)}
    xyz, rgb, observations = [], [], []
    for _, point in sorted(reconstruction.points3D.items()):
        seen = _observed(point, reconstruction, number, frames)
        depths = [frames[index].camera.to_camera(point.xyz)[2] for index in seen]
        if len(seen) < config.min_track or not point.error <= config.max_error_px:
            continue
        if not (DEPTH_RANGE_M[0] < min(depths) and max(depths) < DEPTH_RANGE_M[1]):
            continue
        observations += [(index, len(xyz), pixel) for index, pixel in sorted(seen.items())]
        xyz.append(point.xyz)
        rgb.append(point.color)
    frame, point, pixel = zip(*observations, strict=True) if observations else ((), (), ())
    tracks = Tracks(
        tuple(frame.name for frame in frames),
        np.array(frame, dtype=np.int32),
        np.array(point, dtype=np.int32),
        np.array(pixel, dtype=np.float32).reshape(-1, 2),
    )
    return PointCloud(
        np.array(xyz, dtype=np.float64).reshape(-1, 3), np.array(rgb, dtype=np.uint8).reshape(-1, 3), tracks
    )


def _observed(
    point: pycolmap.Point3D, reconstruction: pycolmap.Reconstruction, number: dict[int, int], frames: Sequence[Frame]
) -> dict[int, np.ndarray]:
    """Frame index -> (2,) pixel, with COLMAP's pixel centres, which are ours (+0.5).

    A track may hold two features of one photo: the one nearer to the point's projection counts.
    """
    seen: dict[int, np.ndarray] = {}
    errors: dict[int, float] = {}
    for element in point.track.elements:
        index = number[element.image_id]
        pixel = reconstruction.image(element.image_id).point2D(element.point2D_idx).xy
        error = float(np.linalg.norm(frames[index].camera.project(point.xyz)[0] - pixel))
        if index not in seen or error < errors[index]:
            seen[index], errors[index] = pixel, error
    return seen
