"""Checks that a mesh and its ground truth are in one frame and unit; otherwise every score would be 0."""

from __future__ import annotations

import numpy as np
import trimesh

from room2dgs.errors import InputError

SHARE = 0.01  # of the faces at either end, which may be strays
MOST_TIMES_AS_LARGE = 15.0  # a part of a room, or a room of a flat
UNITS = ((1000.0, "millimetres"), (100.0, "centimetres"), (39.37, "inches"))
FAR_M, FAR_TIMES = 1e4, 100.0  # where float32 has steps of a millimetre; the distance of most faces from the middle
SURE = 1.6  # factor to both sides by which sizes tell a unit


def check_together(mesh: trimesh.Trimesh, name: str) -> None:
    """Check that no face of a mesh is far from the others.

    Distances are found in float32 about the middle of a mesh. One vertex that is 1e8 m away leaves the room steps of
    4 m there, and every query as near to one face as to all others.

    Raises:
        InputError: a few faces reach far out; names how many.
    """
    corners = np.asarray(mesh.vertices, np.float64)[mesh.faces]
    if not len(corners) or not np.ptp(corners.reshape(-1, 3), axis=0).max() > FAR_M:
        return
    away = np.linalg.norm(corners - np.median(corners.reshape(-1, 3), axis=0), axis=-1).max(axis=1)
    limit = max(FAR_M, FAR_TIMES * float(np.quantile(away, 0.5)))
    far = int((away > limit).sum())
    if far:
        raise InputError(
            f"{name} has {far:,} of {len(away):,} faces that reach up to {away.max():.0e} m away from the rest: too "
            "far to tell millimetres; remove them"
        )


def misplaced(mesh: trimesh.Trimesh, truth: trimesh.Trimesh) -> str | None:
    """A sentence on two meshes whose sizes or places are so different that one is in another unit or world.

    Args:
        mesh, truth: in one world, metres.
    """
    (low, high), (truth_low, truth_high) = _box(mesh), _box(truth)
    sizes = [float(np.linalg.norm(top - bottom)) for bottom, top in ((low, high), (truth_low, truth_high))]
    if min(sizes) <= 0:
        return None
    times = sizes[1] / sizes[0]
    larger, smaller = ("ground truth", "mesh") if times > 1 else ("mesh", "ground truth")
    factor = max(times, 1 / times)
    if factor > MOST_TIMES_AS_LARGE:
        unit = next((name for many, name in UNITS if many / SURE < factor < many * SURE), None)
        guess = f": it looks like {unit}; write it in metres" if unit else "; write both in metres"
        return f"the {larger} is {factor:,.0f} times as large as the {smaller}{guess}"
    gap = float(np.linalg.norm(np.maximum(0.0, np.maximum(low - truth_high, truth_low - high))))
    if gap > 0:
        return (
            f"the mesh and the ground truth lie {gap:.3g} m apart, as if they were of two worlds; give eval.align=icp, "
            "or eval.align=cameras with eval.align_scene"
        )
    return None


def _box(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    """(3,), (3,) where the faces' middles begin and end."""
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    low, high = np.quantile(middles, (SHARE, 1 - SHARE), axis=0) if len(middles) else np.zeros((2, 3))
    return low, high
