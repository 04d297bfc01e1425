"""Pairs of photos whose matches contradict the poses, as in a model with wrong loop closures."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.colmap import pycolmap

LEAST_MATCHES = 15
MAX_ERROR_PX = 4.0
CONTRADICTS = 0.5  # of a pair's matches off their epipolar lines
DOUBTFUL = 0.08  # of the pairs; right models have up to 0.05, since walls and doors repeat


class Contradictions(NamedTuple):
    """Attributes:
    share: of the pairs of placed photos that match.
    pairs: the names of those with most matches, most first.
    """

    share: float
    pairs: list[tuple[str, str]]


def contradictions(model: pycolmap.Reconstruction, database: Path, most: int = 3) -> Contradictions:
    """Asks every verified pair of placed photos for its epipolar geometry."""
    placed = set(model.reg_image_ids())
    with pycolmap.Database.open(database) as opened:
        pair_ids, geometries = opened.read_two_view_geometries()
    judged, wrong = 0, []
    for pair_id, geometry in zip(pair_ids, geometries, strict=True):
        first, second = pycolmap.pair_id_to_image_pair(pair_id)
        matches = np.asarray(geometry.inlier_matches)
        if first not in placed or second not in placed or len(matches) < LEAST_MATCHES:
            continue
        judged += 1
        one, other = model.image(first), model.image(second)
        if (_sampson(one, other, matches) > MAX_ERROR_PX).mean() > CONTRADICTS:
            wrong.append((len(matches), one.name, other.name))
    named = [(one, other) for _, one, other in sorted(wrong, key=lambda pair: (-pair[0], pair[1:]))[:most]]
    return Contradictions(len(wrong) / judged if judged else 0.0, named)


def _sampson(one: pycolmap.Image, other: pycolmap.Image, matches: np.ndarray) -> np.ndarray:
    """(N,) Sampson distances under the poses, pixels."""
    rays = []
    for image, features in ((one, matches[:, 0]), (other, matches[:, 1])):
        points = image.points2D
        pixel = np.array([points[int(index)].xy for index in features])
        assert image.camera is not None  # as of all images of a reconstruction
        rays.append(np.c_[image.camera.cam_from_img(pixel), np.ones(len(pixel))])
    other_from_one = (other.cam_from_world() * one.cam_from_world().inverse()).matrix()
    x, y, z = other_from_one[:, 3]
    essential = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ other_from_one[:, :3]
    assert one.camera is not None
    line, back = rays[0] @ essential.T, rays[1] @ essential
    size = np.sqrt((line[:, :2] ** 2).sum(axis=1) + (back[:, :2] ** 2).sum(axis=1))
    return np.abs((rays[1] * line).sum(axis=1)) / np.maximum(size, 1e-12) * one.camera.mean_focal_length()
