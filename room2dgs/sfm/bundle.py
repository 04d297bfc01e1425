"""Bundle adjustment by pycolmap with priors at the given poses, and alignment to their frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from room2dgs.captures.lens import Lens
from room2dgs.captures.point_cloud import Tracks
from room2dgs.colmap import pycolmap
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import pose_at
from room2dgs.sfm.matching import pinhole, quiet
from room2dgs.sfm.motion_scale import common_scale

ITERATIONS = 50
FAR_M = 1e4
PRIOR_IDS = 1_000_000  # ids of the rotation priors' images and cameras begin here, above those of photos
PRIOR_PX = 1000
FOCAL_ID = 2 * PRIOR_IDS  # of the image that is the focal length's prior
FOCAL_SPREAD = 0.01  # relative standard deviation of a given focal length: autofocus, and what vendors round
ALIGNMENT_ROUNDS = 4
MIN_REACH = 3.0  # times the scatter of the centres: cameras nearer to each other only turned and have no scale


class Spread(NamedTuple):
    """Standard deviations by which a bundle adjustment weighs its terms.

    Attributes:
        metres: of each coordinate of a given centre.
        degrees: of a given rotation about each axis.
        pixels: of each coordinate of an observation.
    """

    metres: float
    degrees: float
    pixels: float


def bundle_adjusted(
    cameras: Sequence[Camera],
    given: Sequence[Camera],
    tracks: Tracks,
    xyz: np.ndarray,
    loss_px: float,
    spread: Spread,
) -> list[Camera]:
    """Poses and points that minimise the reprojection errors, with priors at the given centres and rotations.

    The cost is Cauchy's loss of the errors over `loss_px`, plus the squared change of each centre and rotation over its
    spread. (Where photos see little depth, a rotation looks almost like a shift, so too strong a rotation prior moves
    the centre.) Intrinsics are constant. One thread, since the order of Ceres' sums depends on the number of threads.

    Args:
        cameras: with poses to start from.
        given: the same with the given poses.
        tracks: of all of these cameras; photos without an observation keep their pose.
        xyz: (M, 3) points to start from, metres.
    """
    models = [pinhole(camera) for camera in cameras]
    rebuilt = _solved(models, range(1, len(cameras) + 1), cameras, given, tracks, xyz, spread, _options(loss_px))
    return _with_poses(cameras, rebuilt)


def lens_adjusted(
    cameras: Sequence[Camera],
    given: Sequence[Camera],
    tracks: Tracks,
    xyz: np.ndarray,
    loss_px: float,
    spread: Spread,
) -> tuple[list[Camera], Lens]:
    """As `bundle_adjusted`, and with one lens for all photos: focal lengths, radial and tangential distortion.

    The lens is COLMAP's OPENCV and begins with the first camera's K and no distortion. The principal point is constant,
    since moving it is almost the same as a rotation.
    """
    options = _options(loss_px)
    options.refine_focal_length = options.refine_extra_params = True
    model = pinhole(cameras[0])
    one = pycolmap.Camera(
        model="OPENCV", width=model.width, height=model.height, params=[*model.params, 0.0, 0.0, 0.0, 0.0]
    )
    rebuilt = _solved([one] * len(cameras), [1] * len(cameras), cameras, given, tracks, xyz, spread, options)
    lens = Lens("OPENCV", tuple(float(x) for x in rebuilt.camera(1).params), cameras[0].size, "the photos' own lens")
    return _with_poses(cameras, rebuilt), lens


def focal_adjusted(
    cameras: Sequence[Camera],
    given: Sequence[Camera],
    tracks: Tracks,
    xyz: np.ndarray,
    loss_px: float,
    spread: Spread,
) -> list[Camera]:
    """As `bundle_adjusted`, and with the focal length of all photos, which have the same K, adjusted.

    A wrong focal length is made up for by the distance of all points, so reprojection errors hardly tell it and the
    scale of the depth is off. Both focal lengths change by one factor. Its prior is the given one, by `FOCAL_SPREAD`.
    """
    options = _options(loss_px)
    options.refine_focal_length = True
    first, original = cameras[0], given[0]
    (fx, fy), (cx, cy) = first.K[(0, 1), (0, 1)], first.K[:2, 2]
    square = tracks.pixel.astype(np.float64)  # as if pixels were square: pycolmap's other cameras have two factors
    square[:, 1] = cy + (square[:, 1] - cy) * (fx / fy)
    model = pycolmap.Camera(model="SIMPLE_PINHOLE", width=first.width, height=first.height, params=[fx, cx, cy])
    seen = Tracks(tracks.frames, tracks.frame, tracks.point, square)
    each = [1] * len(cameras)
    rebuilt = _solved([model] * len(cameras), each, cameras, given, seen, xyz, spread, options, original.K[0, 0])
    factor = float(rebuilt.camera(1).focal_length) / fx
    return [camera.zoomed(factor) for camera in _with_poses(cameras, rebuilt)]


def _solved(
    models: Sequence[pycolmap.Camera],
    numbers: Sequence[int],
    cameras: Sequence[Camera],
    given: Sequence[Camera],
    tracks: Tracks,
    xyz: np.ndarray,
    spread: Spread,
    options: pycolmap.BundleAdjustmentOptions,
    given_focal: float | None = None,
) -> pycolmap.Reconstruction:
    """The adjusted photos, numbered from 1 on.

    Args:
        models, numbers: of each photo its intrinsics and their number; photos may share one.
        given_focal: where the prior of camera 1's focal length is, pixels; None: it has no prior.
    """
    rebuilt = pycolmap.Reconstruction()
    observed = [np.flatnonzero(tracks.frame == index) for index in range(len(cameras))]
    used = [index for index, rows in enumerate(observed) if len(rows)]
    row_in_image = np.zeros(len(tracks), np.int64)
    priors = []
    for index in used:
        camera, rows = cameras[index], observed[index]
        row_in_image[rows] = np.arange(len(rows))
        image = pycolmap.Image(
            name=str(index),
            keypoints=tracks.pixel[rows].astype(np.float64),
            camera_id=numbers[index],
            image_id=index + 1,
        )
        _add(rebuilt, image, camera, models[index], rotation_prior_camera(spread))
        priors.append(_prior(rebuilt.image(index + 1), given[index].centre, spread.metres / spread.pixels))
    start = np.searchsorted(tracks.point, np.arange(len(xyz) + 1))
    for point, place in enumerate(xyz):
        track = pycolmap.Track()
        for row in range(start[point], start[point + 1]):
            track.add_element(int(tracks.frame[row]) + 1, int(row_in_image[row]))
        rebuilt.add_point3D(place, track)
    config, prior_camera = pycolmap.BundleAdjustmentConfig(), rotation_prior_camera(spread)
    for index in used:
        config.add_image(index + 1)
        config.add_image(PRIOR_IDS + index)
        config.set_constant_cam_intrinsics(PRIOR_IDS + numbers[index] - 1)
        for number, place in enumerate(far_points(given[index], prior_camera)):
            track = pycolmap.Track()
            for twice in range(2):  # pycolmap wants two observations of a point
                track.add_element(PRIOR_IDS + index, 2 * number + twice)
            config.add_constant_point(rebuilt.add_point3D(place, track))
    if given_focal is not None:
        _add_focal_prior(rebuilt, config, given_focal, spread.pixels)
    alignment = pycolmap.PosePriorBundleAdjustmentOptions()
    alignment.alignment_ransac.random_seed = 0
    with quiet():
        pycolmap.create_pose_prior_bundle_adjuster(options, alignment, config, priors, rebuilt).solve()
    return rebuilt


def _with_poses(cameras: Sequence[Camera], rebuilt: pycolmap.Reconstruction) -> list[Camera]:
    """The cameras with their adjusted poses; those without one as they are."""
    found = list(cameras)
    for index, camera in enumerate(cameras):
        if index + 1 in rebuilt.images:
            pose = np.eye(4)
            pose[:3] = rebuilt.image(index + 1).cam_from_world().matrix()
            found[index] = replace(camera, cam_from_world=pose)
    return found


def rotation_prior_camera(spread: Spread) -> pycolmap.Camera:
    """The virtual camera whose observations of `far_points` act as a prior of a photo's rotation.

    pycolmap has no prior for rotations. Four observations of points far away, by a camera that is rigidly joined to the
    photo's own, cost (2 f angle)^2 pixels^2. The focal length f makes that the cost of the spread's angle.
    """
    focal = spread.pixels / (2 * np.radians(spread.degrees))
    return pycolmap.Camera(
        model="PINHOLE", width=PRIOR_PX, height=PRIOR_PX, params=[focal, focal, PRIOR_PX / 2, PRIOR_PX / 2]
    )


def far_points(given: Camera, prior_camera: pycolmap.Camera) -> np.ndarray:
    """(2, 3) fixed points so far away that only the camera's rotation decides where it sees them, metres."""
    rays = np.append(prior_camera.cam_from_img(_prior_pixels(prior_camera)), np.ones((2, 1)), axis=1)
    return given.centre + FAR_M * rays @ given.rotation


def _prior_pixels(prior_camera: pycolmap.Camera) -> np.ndarray:
    """(2, 2) pixels to the left and to the right of the axis, which fix the roll, too."""
    middle, focal = PRIOR_PX / 2, prior_camera.focal_length_x
    return np.array([(middle - focal / 2, middle), (middle + focal / 2, middle)])


def _add(
    rebuilt: pycolmap.Reconstruction,
    image: pycolmap.Image,
    camera: Camera,
    model: pycolmap.Camera,
    prior_camera: pycolmap.Camera,
) -> None:
    """Add a photo and, in the same rig, the virtual image of its rotation prior; shared intrinsics share a rig."""
    index, number = image.image_id - 1, image.camera_id
    model.camera_id, prior_camera.camera_id = number, PRIOR_IDS + number - 1
    prior_image = pycolmap.Image(
        name=f"{image.name} held",
        keypoints=np.repeat(_prior_pixels(prior_camera), 2, axis=0),
        camera_id=prior_camera.camera_id,
        image_id=PRIOR_IDS + index,
    )
    if number not in rebuilt.cameras:
        rig = pycolmap.Rig(rig_id=number)
        rig.add_ref_sensor(model.sensor_id)
        rig.add_sensor(prior_camera.sensor_id, pycolmap.Rigid3d())
        for one in (model, prior_camera):
            rebuilt.add_camera(one)
        rebuilt.add_rig(rig)
    frame = pycolmap.Frame(frame_id=index + 1, rig_id=number)
    frame.rig_from_world = pycolmap.Rigid3d(camera.cam_from_world[:3])
    for seen in (image, prior_image):
        seen.frame_id = frame.frame_id
        frame.add_data_id(seen.data_id)
    rebuilt.add_frame(frame)
    for seen in (image, prior_image):
        rebuilt.add_image(seen)
    rebuilt.register_frame(frame.frame_id)


def _add_focal_prior(
    rebuilt: pycolmap.Reconstruction, config: pycolmap.BundleAdjustmentConfig, focal: float, pixels: float
) -> None:
    """A photo by camera 1 that stays where it is and sees fixed points where the given focal length has them.

    pycolmap has no prior for focal lengths. Four observations at a tangent t off the axis cost (2 t change)^2 pixels^2;
    t makes that an observation's variance at a change of `FOCAL_SPREAD`.
    """
    camera = rebuilt.camera(1)
    tangent = pixels / (2 * FOCAL_SPREAD * focal)
    axis = np.array([camera.principal_point_x, camera.principal_point_y])
    aside = np.array([tangent * focal, 0.0])
    image = pycolmap.Image(
        name="focal length held",
        keypoints=np.repeat([axis - aside, axis + aside], 2, axis=0),
        camera_id=camera.camera_id,
        image_id=FOCAL_ID,
    )
    frame = pycolmap.Frame(frame_id=FOCAL_ID, rig_id=1)
    frame.rig_from_world = pycolmap.Rigid3d()
    image.frame_id = frame.frame_id
    frame.add_data_id(image.data_id)
    rebuilt.add_frame(frame)
    rebuilt.add_image(image)
    rebuilt.register_frame(frame.frame_id)
    config.add_image(FOCAL_ID)
    config.set_constant_rig_from_world_pose(FOCAL_ID)
    for number, side in enumerate((-tangent, tangent)):
        track = pycolmap.Track()
        for twice in range(2):
            track.add_element(FOCAL_ID, 2 * number + twice)
        config.add_constant_point(rebuilt.add_point3D(np.array([side, 0.0, 1.0]), track))


class Aligned(NamedTuple):
    """Cameras in the frame of given ones, and the scale by which they had to be multiplied."""

    cameras: list[Camera]
    scale: float


def aligned(cameras: Sequence[Camera], given: Sequence[Camera], which: np.ndarray) -> Aligned:
    """The cameras in the frame of the given ones: turned, shifted and scaled as a whole.

    Centres and rotations are used together, each weighed by its own scatter; outliers do not count. The scale is that
    of the centres and of the ways between them (`common_scale`). Where the cameras reach less than ten times the
    scatter, it is the inverse of the regression of the found on the given ones: photos tell centres of a camera that
    turns on the spot badly, and the other regression would make the room smaller by their scatter.

    Args:
        which: (V,) bool, the cameras that are aligned as one group; the others are returned as they are.
    """
    index = np.flatnonzero(which).tolist()
    to, found_centres = (np.stack([some[i].centre for i in index]) for some in (given, cameras))
    turned = np.stack([given[i].rotation.T @ cameras[i].rotation for i in index])
    weight = np.ones(len(index))
    scale, rotation, shift = 1.0, np.eye(3), np.zeros(3)
    for _ in range(ALIGNMENT_ROUNDS):
        moved = np.linalg.norm(to - (scale * found_centres @ rotation.T + shift), axis=1)
        angle = np.radians(angles_deg(turned, rotation))
        sigma_m, sigma_rad = (max(_middle(values, weight), 1e-6) for values in (moved, angle))
        weight = ((moved < 4 * sigma_m) & (angle < 4 * sigma_rad)).astype(np.float64)
        mean_to, mean_found = (np.average(points, axis=0, weights=weight) for points in (to, found_centres))
        centres = ((to - mean_to) * weight[:, None]).T @ (found_centres - mean_found) / sigma_m**2
        rotation = _nearest_rotation(centres + (turned * weight[:, None, None]).sum(axis=0) / (2 * sigma_rad**2))
        straight = (found_centres - mean_found) @ rotation.T
        spread = np.sum(weight[:, None] * straight**2)
        given_spread = np.sum(weight[:, None] * (to - mean_to) ** 2)
        common = np.sum(weight[:, None] * (to - mean_to) * straight)
        if spread > 100 * weight.sum() * sigma_m**2:
            scale = float(common / spread)
        elif given_spread > MIN_REACH**2 * weight.sum() * sigma_m**2 and common > 0:
            scale = float(given_spread / common)
        shift = mean_to - scale * rotation @ mean_found
    if spread > 100 * weight.sum() * sigma_m**2:
        kept = [i for i, near in zip(index, weight, strict=True) if near]
        scale = common_scale([_turned(cameras[i], rotation) for i in kept], [given[i] for i in kept])
        shift = mean_to - scale * rotation @ mean_found
    found = list(cameras)
    for i in index:
        centre = scale * rotation @ cameras[i].centre + shift
        found[i] = replace(cameras[i], cam_from_world=pose_at(cameras[i].rotation @ rotation.T, centre))
    return Aligned(found, scale)


def _turned(camera: Camera, rotation: np.ndarray) -> Camera:
    """The camera in a world that is turned about its origin."""
    return replace(camera, cam_from_world=pose_at(camera.rotation @ rotation.T, rotation @ camera.centre))


def moves(cameras: Sequence[Camera], given: Sequence[Camera]) -> tuple[np.ndarray, np.ndarray]:
    """How far each camera is from the given one: (V,) metres between centres and (V,) degrees."""
    metres = np.array([np.linalg.norm(one.centre - other.centre) for one, other in zip(cameras, given, strict=True)])
    turned = np.stack([one.rotation.T @ other.rotation for one, other in zip(cameras, given, strict=True)])
    return metres, angles_deg(turned, np.eye(3))


def angles_deg(rotations: np.ndarray, about: np.ndarray) -> np.ndarray:
    """(N,) degrees between rotations (N, 3, 3) and one (3, 3); exact for small ones, too."""
    off = np.linalg.norm(rotations - about, axis=(1, 2))
    return np.degrees(2 * np.arcsin((off / np.sqrt(8)).clip(0.0, 1.0)))


def _middle(values: np.ndarray, weight: np.ndarray) -> float:
    return float(np.median(values[weight > 0]))


def _nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    u, _, vt = np.linalg.svd(matrix)
    return u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt


def _prior(image: pycolmap.Image, centre: np.ndarray, sigma_m: float) -> pycolmap.PosePrior:
    prior = pycolmap.PosePrior()
    prior.pose_prior_id = image.image_id
    prior.corr_data_id = image.data_id
    prior.position = centre
    prior.position_covariance = sigma_m**2 * np.eye(3)
    prior.coordinate_system = pycolmap.PosePriorCoordinateSystem.CARTESIAN
    return prior


def _options(loss_px: float) -> pycolmap.BundleAdjustmentOptions:
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_sensor_from_rig = False
    options.refine_focal_length = options.refine_principal_point = options.refine_extra_params = False
    options.print_summary = False
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = loss_px
    options.ceres.solver_options.num_threads = 1
    options.ceres.solver_options.max_num_iterations = ITERATIONS
    options.ceres.solver_options.function_tolerance = 1e-6
    return options
