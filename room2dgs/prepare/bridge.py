"""Similarity between two models of one capture, from points that their photos have in common."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.colmap import pycolmap

SEED = 0
MAX_ERROR_PX = 8.0  # between where a photo of one model sees a point and where the other's point lies in it
MOST_POINTS = 4000  # of which a similarity is made
LEAST_POINTS = 20  # in the same place, of one similarity
LEAST_SHARE = 0.25  # of all that matches say
LEAST_PAIRS = 3  # of photos: one pair alone may show two things that look alike
ROUNDS = 3


class Common(NamedTuple):
    """Points that are in both models, a row each.

    Attributes:
        base, other: (N, 3) the point in either model's frame.
        base_image, other_image: (N,) photos that see it.
        base_pixel, other_pixel: (N, 2) where.
    """

    base: np.ndarray
    other: np.ndarray
    base_image: np.ndarray
    other_image: np.ndarray
    base_pixel: np.ndarray
    other_pixel: np.ndarray


def bridged(base: pycolmap.Reconstruction, other: pycolmap.Reconstruction, database: Path) -> pycolmap.Sim3d | None:
    """base_from_other by RANSAC over common points; None: too few are inliers."""
    common = common_points(base, other, database)
    if len(common.base) < LEAST_POINTS:
        return None
    some = np.unique(np.linspace(0, len(common.base) - 1, MOST_POINTS).round().astype(int))
    common = Common(*(column[some] for column in common))
    options = pycolmap.RANSACOptions()
    options.random_seed = SEED
    options.max_error = _tolerance(base, common)
    options.min_inlier_ratio = LEAST_SHARE / 2  # what is less is refused: it ends the search
    robust = pycolmap.estimate_sim3d_robust(common.other, common.base, options)
    found = robust and robust["tgt_from_src"]  # type: ignore[index]  # a dict, unlike what the stubs say
    for _ in range(ROUNDS):
        if found is None:
            return None
        good = _consistent(base, other, common, found)
        pairs = set(zip(common.base_image[good].tolist(), common.other_image[good].tolist(), strict=True))
        if good.sum() < max(LEAST_POINTS, LEAST_SHARE * len(good)) or len(pairs) < LEAST_PAIRS:
            return None
        found = pycolmap.estimate_sim3d(common.other[good], common.base[good])
    return found


def common_points(base: pycolmap.Reconstruction, other: pycolmap.Reconstruction, database: Path) -> Common:
    """Points of photos that are in both models, and of verified matches between photos of either."""
    rows: list[tuple] = []
    in_base, in_other = set(base.reg_image_ids()), set(other.reg_image_ids())
    for image_id in sorted(in_base & in_other):
        every = np.arange(base.image(image_id).num_points2D())
        _add(rows, base, other, image_id, image_id, np.stack([every, every], axis=1))
    with pycolmap.Database.open(database) as opened:
        pair_ids, geometries = opened.read_two_view_geometries()
    for pair_id, geometry in sorted(zip(pair_ids, geometries, strict=True), key=lambda entry: entry[0]):
        first, second = pycolmap.pair_id_to_image_pair(pair_id)
        matches = np.asarray(geometry.inlier_matches)
        if first in in_base and second in in_other:
            _add(rows, base, other, first, second, matches)
        if second in in_base and first in in_other:
            _add(rows, base, other, second, first, matches[:, ::-1])
    if not rows:
        return Common(*np.zeros((2, 0, 3)), *np.zeros((2, 0), np.int64), *np.zeros((2, 0, 2)))
    return Common(*(np.array(column) for column in zip(*rows, strict=True)))


def _add(
    rows: list[tuple],
    base: pycolmap.Reconstruction,
    other: pycolmap.Reconstruction,
    base_image: int,
    other_image: int,
    matches: np.ndarray,
) -> None:
    first, second = base.image(base_image).points2D, other.image(other_image).points2D
    for a, b in matches.tolist():
        one, two = first[a], second[b]
        if one.has_point3D() and two.has_point3D():
            xyz = base.point3D(one.point3D_id).xyz, other.point3D(two.point3D_id).xyz
            rows.append((*xyz, base_image, other_image, one.xy, two.xy))


def _tolerance(base: pycolmap.Reconstruction, common: Common) -> float:
    """RANSAC's threshold in the base's unit: `MAX_ERROR_PX` at the common points' distance."""
    centres = np.array([base.image(int(i)).projection_center() for i in common.base_image])
    camera = base.image(int(common.base_image[0])).camera
    assert camera is not None  # as of all images of a reconstruction
    return (
        2.0
        * MAX_ERROR_PX
        / camera.mean_focal_length()
        * float(np.median(np.linalg.norm(common.base - centres, axis=1)))
    )


def _consistent(
    base: pycolmap.Reconstruction,
    other: pycolmap.Reconstruction,
    common: Common,
    base_from_other: pycolmap.Sim3d,
) -> np.ndarray:
    """(N,) bool: inliers, whose reprojection errors are small in both models."""
    there = _errors(base, common.base_image, base_from_other * common.other, common.base_pixel)
    back = _errors(other, common.other_image, base_from_other.inverse() * common.base, common.other_pixel)
    return np.maximum(there, back) < MAX_ERROR_PX


def _errors(model: pycolmap.Reconstruction, images: np.ndarray, xyz: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    """(N,) reprojection errors, pixels; infinite behind the camera."""
    errors = np.full(len(xyz), np.inf)
    for image_id in np.unique(images):
        image, which = model.image(int(image_id)), images == image_id
        in_cam = image.cam_from_world() * xyz[which]
        assert image.camera is not None
        seen = image.camera.img_from_cam(in_cam)
        off = np.linalg.norm(seen - pixel[which], axis=1)
        errors[which] = np.where((in_cam[:, 2] > 0) & np.isfinite(off), off, np.inf)
    return errors
