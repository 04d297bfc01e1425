"""How well a reconstruction determines its focal length, from the covariance of its bundle adjustment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import sparse

from room2dgs.captures.selection import evenly_spaced
from room2dgs.colmap import pycolmap

MOST_PHOTOS = 150  # that are looked at: fewer make the answer larger, never too small
CENTRE_SIGMA = 0.01  # of the longer side: how far a principal point may lie from the middle, which is not adjusted
STEP = 1e-5  # of numerical derivatives, relative
RIDGE = 1e-12  # relative: what nothing determines becomes very uncertain, and no error
SHARPEST_PX = 0.02  # no feature is found better


class LensEstimate(NamedTuple):
    """The lens of the camera with most photos, as its adjustment determines it.

    Attributes:
        camera_id: of that camera.
        values: (1+E,) logarithm of the focal length in pixels, and E parameters of the distortion.
        covariance: (1+E, 1+E) of these.
    """

    camera_id: int
    values: np.ndarray
    covariance: np.ndarray


class _Seen(NamedTuple):
    """What one photo observes: derivatives of M pixels, flattened to 2M rows."""

    pose: np.ndarray  # (2M, 6) by turning and moving the camera
    lens: np.ndarray  # (2M, C) by the lens' parameters
    point: np.ndarray  # (M, 2, 3) by the points, world frame
    rows: np.ndarray  # (M,) which points these are
    residual: np.ndarray  # (2M,) pixels


def lens_estimate(model: pycolmap.Reconstruction) -> LensEstimate | None:
    """The lens with its covariance, with poses and points free, and the principal point within `CENTRE_SIGMA`.

    The gauge is fixed by the first photo and the longest component of the way to the one farthest from it. Errors of
    features are taken as independent, so the truth may be several of these off.

    Returns:
        None for a model without a point of two photos.
    """
    ids = evenly_spaced(sorted(model.reg_image_ids()), MOST_PHOTOS)
    place = {point_id: index for index, point_id in enumerate(_seen_twice(model, ids))}
    if not place:
        return None
    first, columns = {}, 6 * len(ids)
    for camera_id in sorted({model.image(image_id).camera_id for image_id in ids}):
        first[camera_id] = columns
        columns += len(model.camera(camera_id).params)
    photos = [_photo(model, image_id, place) for image_id in ids]
    blocks, points, residual = _stacked(model, ids, photos, first, columns, len(place))
    freedom = max(1, len(residual) - columns - 3 * len(place))
    variance = float((residual**2).sum() / freedom)
    normal = _reduced(blocks, points, photos, len(place)) / max(variance, SHARPEST_PX**2)
    for camera_id, column in first.items():
        camera = model.camera(camera_id)
        centre = [column + index for index in camera.principal_point_idxs()]
        normal[centre, centre] += 1 / (CENTRE_SIGMA * max(camera.width, camera.height)) ** 2
    kept = np.setdiff1d(np.arange(columns), _gauge(model, ids))
    main = _main_camera(model, ids)
    values, wanted = _lens(model.camera(main))
    spread = np.zeros((columns, len(values)))
    spread[first[main] : first[main] + len(wanted)] = wanted
    return LensEstimate(main, values, _covariance(normal[np.ix_(kept, kept)], spread[kept]))


def _lens(camera: pycolmap.Camera) -> tuple[np.ndarray, np.ndarray]:
    """(1+E,) values of `LensEstimate`, and (C, 1+E) what each is of the camera's parameters."""
    focals, extra, params = camera.focal_length_idxs(), camera.extra_params_idxs(), np.array(camera.params)
    wanted = np.zeros((len(params), 1 + len(extra)))
    wanted[focals, 0] = 1 / len(focals) / params[focals]
    wanted[extra, 1 + np.arange(len(extra))] = 1.0
    return np.r_[np.log(camera.mean_focal_length()), params[extra]], wanted


def _main_camera(model: pycolmap.Reconstruction, ids: Sequence[int]) -> int:
    used = [model.image(image_id).camera_id for image_id in ids]
    return max(sorted(set(used)), key=used.count)


def _seen_twice(model: pycolmap.Reconstruction, ids: Sequence[int]) -> list[int]:
    chosen = set(ids)
    return [
        point_id
        for point_id, point in sorted(model.points3D.items())
        if len({element.image_id for element in point.track.elements} & chosen) >= 2
    ]


def _photo(model: pycolmap.Reconstruction, image_id: int, place: dict[int, int]) -> _Seen:
    image = model.image(image_id)
    observed = [point for point in image.get_observation_points2D() if point.point3D_id in place]
    index = np.array([place[point.point3D_id] for point in observed], np.int64)
    world = np.array([model.point3D(point.point3D_id).xyz for point in observed]).reshape(-1, 3)
    pixel = np.array([point.xy for point in observed]).reshape(-1, 2)
    cam_from_world = image.cam_from_world().matrix()
    xyz = world @ cam_from_world[:, :3].T + cam_from_world[:, 3]
    camera = pycolmap.Camera(model.camera(image.camera_id).todict())
    here = _pixels(camera, xyz)
    by_xyz = _derivatives(camera, xyz)
    params = np.array(camera.params)
    by_lens = np.empty((len(xyz), 2, len(params)))
    for number, value in enumerate(params):
        step = STEP * max(abs(value), 1.0)
        both = []
        for sign in (1, -1):
            changed = params.copy()
            changed[number] += sign * step
            camera.params = changed.tolist()
            both.append(_pixels(camera, xyz))
        by_lens[:, :, number] = (both[0] - both[1]) / (2 * step)
    turned = -by_xyz @ _crosses(xyz)
    pose = np.concatenate([turned, by_xyz], axis=2)
    off = here - pixel
    good = np.isfinite(np.concatenate([pose, by_lens, off[..., None]], axis=2)).all(axis=(1, 2))  # not behind
    return _Seen(
        pose[good].reshape(-1, 6),
        by_lens[good].reshape(-1, len(params)),
        by_xyz[good] @ cam_from_world[:, :3],
        index[good],
        off[good].reshape(-1),
    )


def _pixels(camera: pycolmap.Camera, xyz: np.ndarray) -> np.ndarray:
    """(M, 2) of points in the camera's frame; NaN where there is none."""
    return np.asarray(camera.img_from_cam(xyz), np.float64).reshape(-1, 2)


def _derivatives(camera: pycolmap.Camera, xyz: np.ndarray) -> np.ndarray:
    """(M, 2, 3) of pixels by points in the camera's frame."""
    step = STEP * np.maximum(np.linalg.norm(xyz, axis=1), 1e-12)
    columns = []
    for axis in range(3):
        move = np.zeros_like(xyz)
        move[:, axis] = step
        columns.append((_pixels(camera, xyz + move) - _pixels(camera, xyz - move)) / (2 * step[:, None]))
    return np.stack(columns, axis=2)


def _crosses(xyz: np.ndarray) -> np.ndarray:
    """(M, 3, 3) matrices of the cross product with each."""
    x, y, z = xyz.T
    zero = np.zeros_like(x)
    return np.stack([np.stack([zero, -z, y], 1), np.stack([z, zero, -x], 1), np.stack([-y, x, zero], 1)], 1)


def _stacked(
    model: pycolmap.Reconstruction,
    ids: Sequence[int],
    seen: Sequence[_Seen],
    first: dict[int, int],
    columns: int,
    points: int,
) -> tuple[sparse.csr_matrix, sparse.csr_matrix, np.ndarray]:
    """Derivatives of all rows by poses and lenses, by points, and the residuals."""
    by_camera, by_point = [], []
    for number, (image_id, photo) in enumerate(zip(ids, seen, strict=True)):
        lens = first[model.image(image_id).camera_id] + np.arange(photo.lens.shape[1])
        where = np.r_[6 * number + np.arange(6), lens]
        rows = len(photo.residual)
        values = np.c_[photo.pose, photo.lens]
        by_camera.append(
            sparse.csr_matrix(
                (values.ravel(), np.tile(where, rows), np.arange(rows + 1) * len(where)), shape=(rows, columns)
            )
        )
        at = np.repeat(3 * photo.rows, 2)[:, None] + np.arange(3)
        by_point.append(
            sparse.csr_matrix(
                (photo.point.reshape(-1, 3).ravel(), at.ravel(), np.arange(rows + 1) * 3), shape=(rows, 3 * points)
            )
        )
    residual = np.concatenate([photo.residual for photo in seen])
    return sparse.vstack(by_camera).tocsr(), sparse.vstack(by_point).tocsr(), residual


def _reduced(blocks: sparse.csr_matrix, points: sparse.csr_matrix, photos: Sequence[_Seen], count: int) -> np.ndarray:
    """Normal equations of poses and lenses, the points eliminated (Schur's complement)."""
    own = np.zeros((count, 3, 3))
    for photo in photos:
        np.add.at(own, photo.rows, np.einsum("mji,mjk->mik", photo.point, photo.point))
    inverse = np.linalg.pinv(own, hermitian=True)
    middle = sparse.bsr_matrix((inverse, np.arange(count), np.arange(count + 1)), shape=(3 * count, 3 * count))
    across = (blocks.T @ points).tocsr()
    return np.asarray((blocks.T @ blocks - across @ middle @ across.T).todense())


def _gauge(model: pycolmap.Reconstruction, ids: Sequence[int]) -> list[int]:
    """Seven columns that are held."""
    centres = np.array([model.image(image_id).projection_center() for image_id in ids])
    far = int(np.linalg.norm(centres - centres[0], axis=1).argmax())
    way = model.image(ids[far]).cam_from_world().rotation.matrix() @ (centres[far] - centres[0])
    return [*range(6), 6 * far + 3 + int(np.abs(way).argmax())]


def _covariance(normal: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Of sums of parameters (C, K), by their normal equations (C, C)."""
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / size[:, None] / size + RIDGE * np.eye(len(size))
    right = wanted / size[:, None]
    return right.T @ np.linalg.solve(scaled, right)
