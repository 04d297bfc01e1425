"""Normal maps put to the test before they are used: their convention, and whether they say anything at all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.config import NormalPriorConfig
from room2dgs.depth.normals.convention import camera_normals, judge
from room2dgs.depth.normals.planar_points import planar_normals
from room2dgs.depth.normals.samples import Sample
from room2dgs.errors import InputError
from room2dgs.logs import Log

# Views of the same points agree less than this, mean cosine: noise, which has at most 0.25, or nearly so.
MIN_AGREEMENT = 0.4
# Mean cosine with the planes of the sparse points, above what normals that just face the camera have.
MIN_GAIN = 0.05
MIN_PLANAR, MOST_PLANAR = 200, 20000


def usable(
    samples: Sequence[Sample], xyz: np.ndarray, settings: NormalPriorConfig, made_of: str | None, log: Log
) -> bool:
    """Whether normals are to be used; what was found is logged.

    Args:
        samples: of some views.
        xyz: (M, 3) the sparse points that the samples' `point` counts.
        settings: with `check` off, doubtful normals are used all the same.
        made_of: the folder or the network, for messages.

    Returns:
        False for normals without information.

    Raises:
        InputError: another convention fits clearly better.
    """
    verdict = judge(samples, settings)
    found = [f"{verdict.score.away:.0%} of the pixels face away from the camera"]
    if verdict.score.cosine is not None:
        found.append(f"mean cosine with the depth prior's normals {verdict.score.cosine:.2f}")
    if verdict.score.agreement is not None:
        found.append(f"between views of the same points {verdict.score.agreement:.2f}")
    planes, facing = _with_planes(samples, xyz, settings)
    if planes is not None:
        found.append(f"with planes of the sparse points {planes:.2f} ({facing:.2f} if all just faced the camera)")
    log(f"normal prior: {', '.join(found)}")
    used = "used all the same" if not settings.check else "left out; prior.normal.check=false uses them all the same"
    if verdict.agreement is not None and verdict.agreement < MIN_AGREEMENT:
        log(
            f"WARNING: the normals carry no information, views of the same points do not agree (mean cosine "
            f"{verdict.agreement:.2f} in the best convention, noise has 0.25 at most): {used}"
        )
        return not settings.check
    if verdict.better and settings.check:
        raise InputError(
            f"{made_of} has its normals in another convention ({', '.join(found)}); {verdict.better} fits best, "
            "or prior.normal.check=false uses them as they are"
        )
    if verdict.better:
        log(f"WARNING: the normals seem to be in another convention, {verdict.better} fits best; used all the same")
    elif verdict.score.cosine is not None and verdict.score.cosine < 0.5:
        log("WARNING: depth and normal priors do not agree; one of them or both are poor")
    elif planes is not None and planes < facing + MIN_GAIN:
        log("WARNING: the normals fit the sparse points no better than if all just faced the camera: they are poor")
    return True


def _with_planes(samples: Sequence[Sample], xyz: np.ndarray, settings: NormalPriorConfig) -> tuple[float | None, float]:
    """Mean cosine of the normals, and of vectors towards the camera, with the points' planes; None: too few."""
    # With stereo's pixels there are hundreds of thousands of points, far more than a mean needs.
    step = 1 + sum(np.count_nonzero(sample.point >= 0) for sample in samples) // MOST_PLANAR
    chosen = [np.flatnonzero(sample.point >= 0)[::step] for sample in samples]
    points = [sample.point[seen] for sample, seen in zip(samples, chosen, strict=True)]
    indices, place = np.unique(np.concatenate([np.zeros(0, np.int64), *points]), return_inverse=True)
    planes = planar_normals(xyz, indices)[place]
    cosines, facing = [np.zeros(0)], [np.zeros(0)]
    ends = np.cumsum([len(seen) for seen in chosen])[:-1]
    for sample, seen, in_world in zip(samples, chosen, np.split(planes, ends), strict=True):
        plane = sample.camera.turned_to_camera(in_world)
        rays = sample.rays[seen] / np.linalg.norm(sample.rays[seen], axis=-1, keepdims=True)
        towards = -(plane * rays).sum(axis=-1)
        normal = camera_normals(sample.raw[seen], settings, sample.camera)
        known = plane.any(axis=-1)
        # a plane has two sides, and the seen one faces the camera
        cosines.append((np.sign(towards) * (normal * plane).sum(axis=-1))[known])
        facing.append(np.abs(towards)[known])
    cosine = np.concatenate(cosines)
    if len(cosine) < MIN_PLANAR:
        return None, 0.0
    return float(cosine.mean()), float(np.concatenate(facing).mean())
