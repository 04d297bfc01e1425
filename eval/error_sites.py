"""Breakdown of the error by kind of surface, number of views and size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from room2dgs.eval.culling import count_views
from room2dgs.eval.protocol_area import AreaResult, Compared
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.up_axis import up_axis

LEVEL_COS = np.cos(np.radians(20.0))  # normal this near to up or down: a level surface
UPRIGHT_COS = np.sin(np.radians(20.0))  # normal this near to the horizontal: a wall or a furniture side
FLOOR_M = 0.15  # level surfaces this near to the lowest (highest) ones are floor (ceiling)
KINDS = ("floor", "ceiling", "upright", "other")
VIEW_BINS = ((1, 2), (3, 5), (6, 15), (16, None))
COUNTED = 20_000  # samples whose views are counted
DISTANCE_BINS = 2  # times the threshold: 1x-2x, 2x-4x, over 4x


def where_the_error_sits(result: AreaResult, pred: Surface, gt: Surface, cameras: Sequence[Camera]) -> dict[str, Any]:
    """Break the wrong samples of protocol `area` down.

    Wrong is: for "precision", a prediction sample at least threshold_m from the ground truth, and for "recall" a
    ground-truth sample at least threshold_m from the prediction. A prediction sample has the kind of its nearest
    true surface.

    Returns:
        {"up": [3], "precision": part, "recall": part}; part has "wrong" (share of all samples) and
        "by_surface", "by_views", "by_distance": name -> {"surface": share of all samples (not by distance),
        "wrong": share of the wrong samples}. Shares are 0..1.
    """
    threshold = result.constants["threshold_m"]
    up = up_axis(cameras, result.gt.normals)
    true_kind, levels = _kinds(result.gt, cameras, up)
    pred_kind = _kinds_of_nearest(result.pred, gt, cameras, up, levels)
    return {
        "up": [float(x) for x in up],
        "precision": _part(result.pred, pred_kind, threshold, cameras, pred, gt),
        "recall": _part(result.gt, true_kind, threshold, cameras, gt, gt),
    }


def far_m(threshold_m: float) -> float:
    """From where on the breakdown by distance has no more bins."""
    return threshold_m * DISTANCE_BINS**2


def far_share(sites: Mapping[str, Any]) -> float:
    """Share of the prediction that is at least `far_m` from the ground truth."""
    part = sites["precision"]
    *_, farthest = part["by_distance"].values()
    return part["wrong"] * farthest["wrong"]


def sentences(sites: dict[str, Any]) -> list[str]:
    """The breakdown in one line for precision and one for recall."""
    lines = []
    for name, what in (("precision", "mesh that is wrong"), ("recall", "surface that is missing")):
        part = sites[name]
        if part["wrong"] == 0:
            lines.append(f"{what}: none")
            continue
        surfaces = ", ".join(f"{kind} {row['wrong']:.0%}" for kind, row in part["by_surface"].items())
        views = ", ".join(f"{kind} {row['wrong']:.0%}" for kind, row in part["by_views"].items())
        sizes = ", ".join(f"{kind} {row['wrong']:.0%}" for kind, row in part["by_distance"].items())
        lines.append(f"{what}: {part['wrong']:.1%}, of it {surfaces}; {views}; {sizes}")
    return lines


def _part(
    compared: Compared,
    kind: np.ndarray,
    threshold: float,
    cameras: Sequence[Camera],
    own: Surface,
    truth: Surface,
) -> dict[str, Any]:
    wrong = ~(compared.distance < threshold)
    step = max(1, len(wrong) // COUNTED)
    some = slice(None, None, step)
    views = count_views(compared.samples.points[some], cameras, own, truth)
    by_views = {_range_name(low, high): (views >= low) & (views <= (high or np.inf)) for low, high in VIEW_BINS}
    return {
        "wrong": _share(wrong),
        "by_surface": {
            name: {"surface": _share(kind == index), "wrong": _share(kind[wrong] == index)}
            for index, name in enumerate(KINDS)
        },
        "by_views": {
            name: {"surface": _share(inside), "wrong": _share(inside[wrong[some]])} for name, inside in by_views.items()
        },
        "by_distance": _by_distance(compared.distance[wrong], threshold),
    }


def _by_distance(distance: np.ndarray, threshold: float) -> dict[str, dict[str, float]]:
    edges = [threshold, threshold * DISTANCE_BINS, far_m(threshold), np.inf]
    rows = {}
    for low, high in pairwise(edges):
        last = f"{low * 100:g}-{high * 100:g} cm" if np.isfinite(high) else f"over {low * 100:g} cm"
        inside = (distance >= low) & ((distance < high) | ~np.isfinite(high))
        rows[last] = {"wrong": _share(inside)}
    return rows


def _kinds(compared: Compared, cameras: Sequence[Camera], up: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
    """(N,) index into KINDS of ground-truth samples, and the heights of floor and ceiling."""
    cosine = _facing(compared.normals, compared.samples.points, compared.view, cameras) @ up
    height = compared.samples.points @ up
    rising, falling = height[cosine > LEVEL_COS], height[cosine < -LEVEL_COS]
    levels = (
        float(np.percentile(rising, 2)) if len(rising) else -np.inf,
        float(np.percentile(falling, 98)) if len(falling) else np.inf,
    )
    return _classify(cosine, height, levels), levels


def _kinds_of_nearest(
    compared: Compared, gt: Surface, cameras: Sequence[Camera], up: np.ndarray, levels: tuple[float, float]
) -> np.ndarray:
    if not len(gt.faces):
        return np.full(len(compared.distance), KINDS.index("other"))
    normals = gt.face_normals[compared.other_triangle]
    cosine = _facing(normals, compared.samples.points, compared.view, cameras) @ up
    # a floater is as high as the true surface nearest to it, up to its own error: good enough to name a kind
    height = compared.samples.points @ up
    return _classify(cosine, height, levels, slack=compared.distance)


def _classify(
    cosine: np.ndarray, height: np.ndarray, levels: tuple[float, float], slack: np.ndarray | float = 0.0
) -> np.ndarray:
    kind = np.full(len(cosine), KINDS.index("other"))
    kind[np.abs(cosine) < UPRIGHT_COS] = KINDS.index("upright")
    kind[(cosine > LEVEL_COS) & (height < levels[0] + FLOOR_M + slack)] = KINDS.index("floor")
    kind[(cosine < -LEVEL_COS) & (height > levels[1] - FLOOR_M - slack)] = KINDS.index("ceiling")
    return kind


def _facing(normals: np.ndarray, points: np.ndarray, view: np.ndarray, cameras: Sequence[Camera]) -> np.ndarray:
    """Normals turned towards the camera that observes each point (a mesh's winding is not trusted)."""
    centres = np.stack([camera.centre for camera in cameras])[view]
    towards = np.einsum("nc,nc->n", normals, centres - points) >= 0
    return np.where(towards[:, None], normals, -normals)


def _range_name(low: int, high: int | None) -> str:
    return f"{low}-{high} views" if high else f"{low}+ views"


def _share(mask: np.ndarray) -> float:
    return float(mask.mean()) if len(mask) else 0.0
