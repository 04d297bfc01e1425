"""A mesh of the sparse points alone: no stereo, no prior, no training."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.commands.stages import use_threads
from room2dgs.commands.untrained import points_alone, untrained_mesh
from room2dgs.config import Config, MeshConfig
from room2dgs.logs import Log

if TYPE_CHECKING:
    import trimesh


def mesh_of_points(scene: Scene, config: Config, out: Path, log: Log, seconds: dict[str, float]) -> None:
    """mesh.ply of the run's sparse points (`surface_of_points`), its figures into metrics.json.

    Raises:
        InputError: too few points, or no surface.
    """
    from room2dgs.mesh.sparse_surface import surface_of_points

    use_threads(config)
    points = points_alone(scene, config, out, log, seconds, "none")

    def surface(settings: MeshConfig) -> trimesh.Trimesh:
        return surface_of_points(points, scene.train, settings, log)

    untrained_mesh(surface, "the sparse points", scene, config, out, log, seconds)
