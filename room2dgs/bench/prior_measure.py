"""A prior measured on the photos of one scene: scores over all frames, pictures of a few."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from room2dgs.bench.prior_in_run import DepthInRun
from room2dgs.bench.prior_prediction import Prediction, prediction
from room2dgs.bench.prior_scores import (
    DepthScore,
    Ranking,
    aligned,
    angles_deg,
    best_constant,
    depth_score,
    normal_scores,
    ranking,
)
from room2dgs.bench.prior_truth import REFERENCE_WIDTH, fitted_planes
from room2dgs.bench.prior_views import View, Views
from room2dgs.captures.selection import evenly_spaced
from room2dgs.config import PriorConfig
from room2dgs.depth.network.maps import KINDS
from room2dgs.depth.network.session import Network
from room2dgs.geometry.camera import Camera
from room2dgs.logs import Log

POOLED_WIDTH = 320  # of a frame, about 320 x 240 evenly spaced pixels go into what is pooled over frames
PICTURED = 4  # frames
PLANE_RADIUS = 4  # of the windows in which normals are made of a depth prior
FACING = np.array([0.0, 0.0, -1.0])


@dataclass
class Picture:
    """One frame's maps, for the page; None where the prior has none.

    Attributes:
        photo: (h, w, 3) uint8.
        true_depth, depth: (H, W) metres, 0 = unknown.
        depth_error, expected_depth_error: (H, W) |error of ln depth|, NaN = unknown.
        true_normal, normal: (H, W, 3) camera frame, 0 = unknown.
        angle, expected_angle: (H, W) degrees, NaN = unknown.
    """

    name: str
    photo: np.ndarray
    true_depth: np.ndarray
    true_normal: np.ndarray
    depth: np.ndarray | None = None
    depth_error: np.ndarray | None = None
    expected_depth_error: np.ndarray | None = None
    normal: np.ndarray | None = None
    angle: np.ndarray | None = None
    expected_angle: np.ndarray | None = None


@dataclass
class SceneScore:
    """A prior on one scene.

    Attributes:
        truth: where the true normals come from.
        frames: measured ones; `missing` more have no map.
        depth: "scale", "scale_shift", "metric" (metric priors) -> mean over frames; empty without a depth prior.
        depth_share, normal_share: of the pixels whose truth is known, those for which the prior has a value.
        normals_from: "prior", "depth" (made of the aligned depth prior) or "none".
        normals: see `normal_scores`.
        constant_normal: the best one; its mean angle, and that of the normal that just faces the camera.
        depth_ranking, normal_ranking: None where the prior expects no errors.
        milliseconds: "depth", "normal", "depth + normal" (one run) -> median and least of the network alone.
        in_run: see `depth_in_run`; empty where that was not asked for.
    """

    scene: str
    truth: str
    frames: int
    missing: int
    depth: dict[str, DepthScore]
    depth_share: float | None
    normals_from: str
    normals: dict[str, float]
    normal_share: float | None
    constant_normal: tuple[float, float, float] | None
    constant_deg: float | None
    facing_deg: float | None
    depth_ranking: Ranking | None
    normal_ranking: Ranking | None
    milliseconds: dict[str, dict[str, float]]
    pictures: list[Picture] = field(default_factory=list)
    in_run: dict[str, DepthInRun] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Everything but the pictures, as plain values."""
        values = dataclasses.asdict(dataclasses.replace(self, pictures=[]))
        values.pop("pictures")
        return values


@dataclass
class _Pool:
    """What is gathered frame by frame."""

    depth: dict[str, list[DepthScore]] = field(default_factory=dict)
    depth_errors: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)  # expected, true
    normal_errors: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    angles: list[np.ndarray] = field(default_factory=list)
    truths: list[np.ndarray] = field(default_factory=list)
    known: dict[str, list[float]] = field(default_factory=lambda: {kind: [] for kind in KINDS})
    milliseconds: dict[str, list[float]] = field(default_factory=dict)
    missing: int = 0


def measured(views: Views, groups: Sequence[Sequence[Network]], config: PriorConfig, log: Log) -> SceneScore:
    """Every frame of a scene through the prior.

    Args:
        groups: what `open_networks` gives for `config`.

    Raises:
        InputError: as `scene_views` and `prediction`.
    """
    pool = _Pool()
    pictures = []
    pictured = evenly_spaced(range(views.photos), PICTURED)
    for index, view in enumerate(views.views):
        if index == 0:  # the first run of a session is slower
            _predicted(view, groups, config)
        found = _predicted(view, groups, config)
        if found is None:
            pool.missing += 1
            continue
        picture = _add(pool, view, found, config)
        if index in pictured:
            pictures.append(picture)
        if (index + 1) % 40 == 0:
            log(f"{views.name}: {index + 1} of {views.photos} frames")
    return _score(views, pool, config, pictures)


def depth_map_normals(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """(H, W, 3) normals of a depth map by planes in windows; all that are in front of the camera, fit or no fit."""
    return fitted_planes(
        depth.astype(np.float64), camera, max(1, round(PLANE_RADIUS * camera.width / REFERENCE_WIDTH))
    )[0]


def _predicted(view: View, groups: Sequence[Sequence[Network]], config: PriorConfig) -> Prediction | None:
    return prediction(view.photo, view.photo_camera, view.camera, view.frame, groups, config)


def _add(pool: _Pool, view: View, found: Prediction, config: PriorConfig) -> Picture:
    """One frame's errors into the pool."""
    picture = Picture(view.name, view.photo, view.truth.depth, view.truth.normal)
    for kind, milliseconds in found.network_ms.items():
        pool.milliseconds.setdefault(kind, []).append(milliseconds)
    grid = (slice(None, None, max(1, round(view.camera.width / POOLED_WIDTH))),) * 2
    if found.depth is not None:
        _add_depth(pool, picture, found, config.depth.meaning, grid)
    normal = found.normal
    if normal is None and picture.depth is not None:
        normal = depth_map_normals(picture.depth, view.camera)
    truth = view.truth.normal[grid]
    known = truth.any(axis=-1)
    pool.truths.append(truth[known].astype(np.float32))
    if normal is not None:
        picture.normal = normal
        _add_normal(pool, picture, normal, found.normal_error, grid)
    return picture


def _add_depth(
    pool: _Pool, picture: Picture, found: Prediction, meaning: str | None, grid: tuple[slice, slice]
) -> None:
    disparity = meaning == "relative_inverse_depth"
    truth = picture.true_depth
    assert found.depth is not None
    valid = (truth > 0) & (found.depth > 0)
    pool.known["depth"].append(float(valid.sum() / max(1, (truth > 0).sum())))
    if not valid.any():
        return
    values, wanted = found.depth[valid], truth[valid]
    fits = {shift: aligned(values, wanted, disparity, shift) for shift in (False, True)}
    candidates = {"scale": fits[False], "scale_shift": fits[True]}
    if meaning == "metric_depth":
        candidates["metric"] = values
    for name, depth in candidates.items():
        pool.depth.setdefault(name, []).append(depth_score(depth, wanted))
    # a prior that knows depth but for its scale is looked at after the scale alone
    best = fits[meaning not in ("metric_depth", "scaled_depth")]
    picture.depth = _filled(valid, best, 0.0)
    picture.depth_error = _filled(valid, np.abs(np.log(best / wanted)), np.nan)
    if found.depth_error is not None:
        picture.expected_depth_error = found.depth_error
        here = valid[grid]
        pool.depth_errors.append((found.depth_error[grid][here], picture.depth_error[grid][here]))


def _add_normal(
    pool: _Pool, picture: Picture, normal: np.ndarray, expected: np.ndarray | None, grid: tuple[slice, slice]
) -> None:
    truth = picture.true_normal
    known = truth.any(axis=-1)
    valid = np.asarray(known & normal.any(axis=-1))
    pool.known["normal"].append(float(valid.sum() / max(1, known.sum())))
    picture.angle = _filled(valid, angles_deg(normal[valid], truth[valid]), np.nan)
    here = valid[grid]
    pool.angles.append(picture.angle[grid][here].astype(np.float32))
    if expected is not None:
        picture.expected_angle = np.degrees(expected)
        pool.normal_errors.append((picture.expected_angle[grid][here], picture.angle[grid][here]))


def _score(views: Views, pool: _Pool, config: PriorConfig, pictures: list[Picture]) -> SceneScore:
    truths = np.concatenate(pool.truths) if pool.truths else np.zeros((0, 3))
    constant = best_constant(truths) if len(truths) else None
    angles = np.concatenate(pool.angles) if pool.angles else np.zeros(0)
    made = "depth" if pool.angles else "none"
    return SceneScore(
        scene=views.name,
        truth=views.source,
        frames=len(pool.truths),
        missing=pool.missing,
        depth={
            name: DepthScore(*(float(np.mean([getattr(one, key) for one in scores])) for key in ("abs_rel", "delta1")))
            for name, scores in pool.depth.items()
        },
        depth_share=_mean(pool.known["depth"]),
        normals_from="prior" if config.normal.source != "none" else made,
        normals=normal_scores(angles) if pool.angles else {},
        normal_share=_mean(pool.known["normal"]),
        constant_normal=None if constant is None else tuple(constant.round(4).tolist()),
        constant_deg=None if constant is None else float(angles_deg(truths, constant).mean()),
        facing_deg=None if constant is None else float(angles_deg(truths, FACING).mean()),
        depth_ranking=_ranking(pool.depth_errors),
        normal_ranking=_ranking(pool.normal_errors),
        milliseconds={
            kind: {"median": float(np.median(times)), "least": float(np.min(times))}
            for kind, times in pool.milliseconds.items()
        },
        pictures=pictures,
    )


def _ranking(errors: list[tuple[np.ndarray, np.ndarray]]) -> Ranking | None:
    if not errors:
        return None
    return ranking(*(np.concatenate([pair[side] for pair in errors]) for side in (0, 1)))


def _filled(valid: np.ndarray, values: np.ndarray, rest: float) -> np.ndarray:
    whole = np.full(valid.shape, rest, dtype=np.float32)
    whole[valid] = values
    return whole


def _mean(values: list[float]) -> float | None:
    return float(np.mean(values)) if values else None
