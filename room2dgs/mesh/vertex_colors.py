"""The colours of a mesh's vertices, where it has some."""

from __future__ import annotations

import numpy as np
import trimesh


def vertex_colors(mesh: trimesh.Trimesh) -> np.ndarray | None:
    """(V, 4) uint8 sRGB and opacity; None where the mesh has no colours, or those of faces or a picture."""
    visual = mesh.visual
    if not isinstance(visual, trimesh.visual.ColorVisuals) or visual.kind != "vertex":
        return None
    return np.asarray(visual.vertex_colors)
