"""The focal length with which straight edges agree on three perpendicular directions of a room."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.captures.image_files import read_photo
from room2dgs.captures.selection import evenly_spaced
from room2dgs.colmap import pycolmap
from room2dgs.geometry.camera import Camera
from room2dgs.prepare.vanishing_points import LEAST_LINES, axes_of_edges, straight_edges

MOST_PHOTOS = 16
RATIOS = np.exp(np.linspace(-0.9, 0.9, 61))  # of the model's focal length
COARSE = 5  # of these, between those from which the room's axes are searched
NARROWING_DEG = (8.0, 5.0, 3.0, 2.0, 2.0, 1.5, 1.5)
EDGE_DEG = 1.0  # of an edge's plane about a direction: wide, since photos see one edge with an error that is alike
SUREST = 0.04  # relative standard deviation: distortion and rooms that are not quite square
CLEAR = 0.4  # share of the edges along the room's directions; edges of anything but a room have less


class EdgesSay(NamedTuple):
    """Attributes:
    log_ratio: logarithm of the focal length over the model's.
    sigma: standard deviation of it.
    """

    log_ratio: float
    sigma: float


class _Edges(NamedTuple):
    """(N, 2, 2) ends, of z = 1 by the model's lens; (N,) lengths; (N, 3, 3) cam_from_world."""

    ends: np.ndarray
    length: np.ndarray
    turn: np.ndarray


def focal_by_edges(model: pycolmap.Reconstruction, images: Path) -> EdgesSay | None:
    """What edges tell if the cameras' orientations are right, which are wrong by little where cameras hardly turned.

    An edge and the camera span a plane that contains the edge's direction. With a wrong focal length planes of
    parallel edges do not meet in one direction, or directions are not perpendicular.

    Args:
        images: folder of the photos.

    Returns:
        None where there are few edges, or they have no three directions.
    """
    ids = evenly_spaced(sorted(model.reg_image_ids()), MOST_PHOTOS)
    edges = _found(model, ids, images)
    if len(edges.length) < LEAST_LINES:
        return None
    cameras = [_camera(model, image_id) for image_id in ids]
    coarse = []
    for ratio in RATIOS[::COARSE]:
        planes = _planes(edges, ratio)
        axes = axes_of_edges(planes, edges.length, cameras).room_from_world.T
        coarse.append(_refined(planes, edges.length, axes))
    share, axes = max(coarse, key=lambda one: one[0])
    if share < CLEAR:
        return None
    shares = np.array([_refined(_planes(edges, ratio), edges.length, axes)[0] for ratio in RATIOS])
    logs = np.log(RATIOS)
    weight = np.exp(len(edges.length) * (shares - shares.max()))
    mean = float(np.average(logs, weights=weight))
    return EdgesSay(mean, max(SUREST, float(np.sqrt(np.average((logs - mean) ** 2, weights=weight)))))


def _found(model: pycolmap.Reconstruction, ids: Sequence[int], images: Path) -> _Edges:
    ends, length, turn = [np.zeros((0, 2, 2))], [np.zeros(0)], [np.zeros((0, 3, 3))]
    for image_id in ids:
        image = model.image(image_id)
        camera = model.camera(image.camera_id)
        pixels, lengths = straight_edges(read_photo(images / image.name, None))
        rays = np.asarray(camera.cam_from_img(pixels.reshape(-1, 2)), np.float64).reshape(-1, 2, 2)
        good = np.isfinite(rays).all(axis=(1, 2))
        ends.append(rays[good])
        length.append(lengths[good])
        turn.append(np.repeat(image.cam_from_world().rotation.matrix()[None], good.sum(), axis=0))
    return _Edges(*(np.concatenate(one) for one in (ends, length, turn)))


def _camera(model: pycolmap.Reconstruction, image_id: int) -> Camera:
    image, pose = model.image(image_id), np.eye(4)
    camera = model.camera(image.camera_id)
    pose[:3] = image.cam_from_world().matrix()
    return Camera(camera.calibration_matrix(), camera.width, camera.height, pose)


def _planes(edges: _Edges, ratio: float) -> np.ndarray:
    """(N, 3) unit normals, world frame, with a focal length of `ratio` times the model's."""
    rays = np.concatenate([edges.ends / ratio, np.ones((*edges.ends.shape[:2], 1))], axis=2)
    normal = np.cross(rays[:, 0], rays[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return np.einsum("nij,ni->nj", edges.turn, normal)


def _refined(planes: np.ndarray, length: np.ndarray, axes: np.ndarray) -> tuple[float, np.ndarray]:
    """The share of the edges' length along three axes (3, 3), a column each, after they were turned to the edges."""
    for degrees in NARROWING_DEG:
        off, which = _off(planes, axes)
        weight = length * np.exp(-((off / np.sin(np.radians(degrees))) ** 2))
        along = axes[:, which].T
        slope = np.cross(along, planes)
        normal = (slope * weight[:, None]).T @ slope + 1e-6 * length.sum() * np.eye(3)
        turn = -np.linalg.solve(normal, (slope * weight[:, None]).T @ (planes * along).sum(axis=1))
        axes = cv2.Rodrigues(turn)[0] @ axes
    off, _ = _off(planes, axes)
    return float(np.average(np.exp(-((off / np.sin(np.radians(EDGE_DEG))) ** 2)), weights=length)), axes


def _off(planes: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) sine of the angle from each plane to the axis that is nearest to it, and (N,) which that is."""
    sine = np.abs(planes @ axes)
    return sine.min(axis=1), sine.argmin(axis=1)
