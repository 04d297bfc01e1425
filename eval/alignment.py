"""Alignment of a prediction to the ground truth's frame by cameras or by surfaces (ICP)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from room2dgs.captures.world_offset import AT_ORIGIN, Origin
from room2dgs.errors import InputError
from room2dgs.eval.alignment_search import guesses
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import inverse_pose

LEAST_PHOTOS = 4
SAMPLES = 20_000  # of each surface
ROUNDS = 40
REACH_M = (0.5, 0.1)  # what counts as the same surface, first and last: samples lie centimetres apart
MIN_INLIER_SHARE = 0.3  # of the prediction
GOOD_INLIER_SHARE = 0.8  # below it other turns are tried
FEW, FEW_ROUNDS = 2500, 16  # samples and rounds of a try
STILL = 1e-7


class Alignment(NamedTuple):
    """A similarity, and how well it fits.

    Attributes:
        method: "cameras" or "icp".
        truth_from_pred: (4, 4): scale times rotation, and translation.
        rms_m: root mean square distance of the aligned camera centres, or of the surfaces' inliers.
        pairs: number of photos, or of points.
        searched: it began from a search over all rotations, not from the meshes' own frames or from cameras.
    """

    method: str
    truth_from_pred: np.ndarray
    rms_m: float
    pairs: int
    searched: bool = False

    @property
    def scale(self) -> float:
        """Metres of the truth that one metre of the prediction is."""
        return float(np.cbrt(np.linalg.det(self.truth_from_pred[:3, :3])))

    def between_worlds(self, pred_origin_m: Origin, truth_origin_m: Origin) -> Alignment:
        """The same in the worlds in which the scenes' origins stand there (`Scene.origin_m`)."""
        if pred_origin_m == truth_origin_m == AT_ORIGIN:
            return self
        matrix = self.truth_from_pred.copy()
        matrix[:3, 3] += truth_origin_m - matrix[:3, :3] @ pred_origin_m
        return self._replace(truth_from_pred=matrix)

    def as_dict(self) -> dict[str, Any]:
        return {
            "method": self.method,
            "scale": self.scale,
            "rms_m": self.rms_m,
            "pairs": self.pairs,
            "searched": self.searched,
            "truth_from_pred": self.truth_from_pred.tolist(),
        }

    def line(self) -> str:
        """For a log."""
        what = "photos" if self.method == "cameras" else "points"
        begun = " after a search over all turns" if self.searched else ""
        return (
            f"aligned to the ground truth by {self.method}{begun}: scale {self.scale:.4f}, {self.pairs} {what}, "
            f"{100 * self.rms_m:.1f} cm rms"
        )


def by_cameras(pred: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], with_scale: bool) -> Alignment:
    """From centres of cameras of the same photos.

    Args:
        pred, truth: (3,) centres by the photos' names; names that differ are matched by their last number.
        with_scale: False: scale 1.

    Raises:
        InputError: too few of them are in both.
    """
    pairs = same_photos(list(pred), list(truth))
    if len(pairs) < LEAST_PHOTOS:
        raise InputError(
            f"eval.align_scene has {len(pairs)} of the run's photos, at least {LEAST_PHOTOS} are needed; give the "
            "capture with the true poses of the same photos"
        )
    first, second = np.array([pred[a] for a, _ in pairs]), np.array([truth[b] for _, b in pairs])
    matrix = similarity(first, second, np.ones(len(first)), with_scale)
    for _ in range(20):  # photos that were placed wrongly do not pull
        error = np.linalg.norm(transformed(first, matrix) - second, axis=1)
        width = max(3 * float(np.median(error)), 1e-9)
        matrix = similarity(first, second, 1 / (1 + (error / width) ** 2) ** 2, with_scale)
    error = np.linalg.norm(transformed(first, matrix) - second, axis=1)
    return Alignment("cameras", matrix, float(np.sqrt((error**2).mean())), len(pairs))


def same_photos(first: list[str], second: list[str]) -> list[tuple[str, str]]:
    """Names that mean the same photo: equal ones, else those with the same last number."""
    known = set(second)
    exact = [(name, name) for name in first if name in known]
    if len(exact) >= min(LEAST_PHOTOS, len(first)):
        return exact
    one, other = _by_number(first), _by_number(second)
    return [(name, other[number]) for number, name in one.items() if number in other]


def _by_number(names: list[str]) -> dict[int, str]:
    """Last number in a name -> name, where it is one name's alone."""
    found: dict[int, list[str]] = {}
    for name in names:
        if numbers := re.findall(r"\d{1,18}", name):
            found.setdefault(int(numbers[-1]), []).append(name)
    return {number: same[0] for number, same in found.items() if len(same) == 1}


def similarity(first: np.ndarray, second: np.ndarray, weights: np.ndarray, with_scale: bool) -> np.ndarray:
    """(4, 4) similarity with the least weighted squared distances between points (N, 3) (Umeyama 1991)."""
    weights = weights / weights.sum()
    mean, other_mean = weights @ first, weights @ second
    a, b = first - mean, second - other_mean
    u, d, vt = np.linalg.svd((b * weights[:, None]).T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = (u * sign) @ vt
    scale = float((d * sign).sum() / max((weights * (a**2).sum(axis=1)).sum(), 1e-30)) if with_scale else 1.0
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = scale * rotation, other_mean - scale * rotation @ mean
    return matrix


def by_surfaces(
    pred: trimesh.Trimesh, truth: trimesh.Trimesh, start: np.ndarray | None, with_scale: bool, seed: int = 0
) -> Alignment:
    """Point-to-plane ICP in both directions.

    It starts from a given transform. Without one it starts from the meshes' own frames; if too few samples are inliers
    then, it starts from the best of all rotations that map the main axes of one room to those of the other.

    Raises:
        InputError: too few samples are inliers.
    """
    surfaces = _Surfaces(*_samples(pred, seed), *_samples(truth, seed + 1))
    found = _icp(surfaces, np.eye(4) if start is None else start, with_scale, ROUNDS)
    searched = start is None and found.inlier_share < GOOD_INLIER_SHARE
    if searched:
        few = _Surfaces(*(values[:: SAMPLES // FEW] for values in surfaces))
        starts = (found.matrix, *guesses(few.points, few.normals, few.truth_points, few.truth_normals, with_scale))
        tried = [_icp(few, guess, with_scale, FEW_ROUNDS) for guess in starts]
        best = min(range(len(tried)), key=lambda index: tried[index].mean_distance_m)
        searched = best > 0
        if searched:
            found = _icp(surfaces, tried[best].matrix, with_scale, ROUNDS)
    if found.inlier_share < MIN_INLIER_SHARE:
        mend = (
            "give eval.align_scene=DIR, the capture with the true poses of the same photos, to start from"
            if start is None
            else "give eval.align=cameras"
        )
        raise InputError(f"eval.align=icp brings only {found.inlier_share:.0%} of the mesh to the ground truth; {mend}")
    rms_m = float(np.sqrt(np.mean(np.minimum(np.abs(found.error), REACH_M[1]) ** 2)))
    return Alignment("icp", found.matrix, rms_m, len(found.error), searched)


class _Surfaces(NamedTuple):
    """(N, 3) points and unit normals of the prediction, (M, 3) of the truth."""

    points: np.ndarray
    normals: np.ndarray
    truth_points: np.ndarray
    truth_normals: np.ndarray


class _IcpResult(NamedTuple):
    """Result of ICP.

    Attributes:
        matrix: (4, 4) truth_from_pred.
        inlier_share: share of the prediction's samples within the last reach of the truth.
        mean_distance_m: over all samples of both, to the other surface, each at most the first reach.
        error: signed distances of the inliers along the truth's normals, metres.
    """

    matrix: np.ndarray
    inlier_share: float
    mean_distance_m: float
    error: np.ndarray


def _icp(surfaces: _Surfaces, matrix: np.ndarray, with_scale: bool, rounds: int) -> _IcpResult:
    points, _, truth_points, truth_normals = surfaces
    truth_tree = cKDTree(truth_points)
    inlier_share, error, distances = 0.0, np.zeros(0), [np.full(1, np.inf)]
    for step in range(rounds):
        reach = max(REACH_M[1], REACH_M[0] * (REACH_M[1] / REACH_M[0]) ** (step / (rounds // 2)))
        here = transformed(points, matrix)
        distance, nearest = truth_tree.query(here, distance_upper_bound=reach)
        good = np.isfinite(distance)
        back, back_nearest = cKDTree(here).query(truth_points, distance_upper_bound=reach)
        back_good = np.isfinite(back)
        inlier_share, distances = float(good.mean()), [distance, back]
        if good.sum() + back_good.sum() < 100:
            break
        source = np.concatenate([here[good], here[back_nearest[back_good]]])
        target = np.concatenate([truth_points[nearest[good]], truth_points[back_good]])
        plane = np.concatenate([truth_normals[nearest[good]], truth_normals[back_good]])
        error = ((target - source) * plane).sum(axis=1)
        # not the median alone: where all else fits exactly, a floor that does not would count for nothing
        width = max(2 * float(np.median(np.abs(error))), reach / 10)
        weights = 1 / (1 + (error / width) ** 2) ** 2
        step_matrix = _small_step(source, plane, error, weights, with_scale)
        matrix = step_matrix @ matrix
        if step > rounds // 2 and np.abs(step_matrix - np.eye(4)).max() < STILL:
            break
    mean_distance_m = float(np.concatenate([np.minimum(values, REACH_M[0]) for values in distances]).mean())
    return _IcpResult(matrix, inlier_share, mean_distance_m, error)


def _small_step(
    source: np.ndarray, plane: np.ndarray, error: np.ndarray, weights: np.ndarray, with_scale: bool
) -> np.ndarray:
    """(4, 4) Gauss-Newton step in rotation, translation and scale."""
    middle = source.mean(axis=0)
    arm = source - middle
    columns = [np.cross(arm, plane), plane]
    if with_scale:
        columns.append((arm * plane).sum(axis=1)[:, None])
    jacobian = np.concatenate(columns, axis=1)
    weighted = jacobian * weights[:, None]
    found = np.linalg.solve(weighted.T @ jacobian + 1e-6 * len(source) * np.eye(jacobian.shape[1]), weighted.T @ error)
    angle = float(np.linalg.norm(found[:3]))
    rotation = np.eye(3)
    if angle > 0:
        x, y, z = found[:3] / angle
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    scale = float(np.exp(np.clip(found[6], -0.1, 0.1))) if with_scale else 1.0
    matrix = np.eye(4)
    matrix[:3, :3] = scale * rotation
    matrix[:3, 3] = middle + found[3:6] - scale * rotation @ middle
    return matrix


def _samples(mesh: trimesh.Trimesh, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points on a surface, evenly by area, and their unit normals."""
    if not len(mesh.faces) or not mesh.area > 0:
        raise InputError("eval.align=icp needs two meshes with surfaces; one of them has none")
    points, face = trimesh.sample.sample_surface(mesh, SAMPLES, seed=seed)
    return np.asarray(points), np.asarray(mesh.face_normals)[face]


def transformed(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """(N, 3) points under a similarity."""
    return np.asarray(points) @ matrix[:3, :3].T + matrix[:3, 3]


def transformed_mesh(mesh: trimesh.Trimesh, matrix: np.ndarray) -> trimesh.Trimesh:
    """A mesh under a similarity."""
    copy = mesh.copy()
    copy.vertices = transformed(copy.vertices, matrix)
    return copy


def transformed_camera(camera: Camera, matrix: np.ndarray) -> Camera:
    """A camera under a similarity: its pose stays rigid."""
    scale = np.cbrt(np.linalg.det(matrix[:3, :3]))
    pose = np.eye(4)
    pose[:3, :3] = matrix[:3, :3] / scale @ camera.world_from_cam[:3, :3]
    pose[:3, 3] = transformed(camera.centre[None], matrix)[0]
    return Camera(camera.K, camera.width, camera.height, inverse_pose(pose))
