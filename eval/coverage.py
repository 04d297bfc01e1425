"""How much of what the views show a mesh has."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from room2dgs.eval.sightlines import Sightlines, same


def covered(mesh: np.ndarray, depth: np.ndarray | None = None) -> np.ndarray:
    """(H, W) bool: pixels whose ray ends on the mesh, and not behind where it should.

    Args:
        mesh: (H, W) z-depth of the mesh, metres; 0 where it has none.
        depth: (H, W) known z-depth; 0 = unknown. A ray that passes a hole and ends on what is behind is not covered.
    """
    hit = mesh > 0
    return hit if depth is None else hit & ((depth == 0) | (mesh <= depth + same(depth)))


def mean_share(parts: Iterable[tuple[np.ndarray, np.ndarray]]) -> float | None:
    """Share of the pixels that are covered, each view with the same weight; None without pixels.

    Args:
        parts: of each view, (H, W) bool that are covered, and that count.
    """
    shares = [float(good[counts].mean()) for good, counts in parts if counts.any()]
    return float(np.mean(shares)) if shares else None


def coverage(views: list[Sightlines]) -> dict[str, float | None]:
    """ "coverage" of all usable pixels, "coverage_known" of those whose depth is known; None where there are none."""
    good = [covered(view.mesh, view.depth) for view in views]
    return {
        "coverage": mean_share((one, view.usable) for one, view in zip(good, views, strict=True)),
        "coverage_known": mean_share((one, view.depth > 0) for one, view in zip(good, views, strict=True)),
    }
