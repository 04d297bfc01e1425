"""mesh.source=points: the sparse points alone, by screened Poisson reconstruction: no stereo, no prior, no training."""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.config import Config, MeshConfig
from room2dgs.pipeline.meshers.mesher import MakeMesh
from room2dgs.pipeline.points import find_points_alone
from room2dgs.pipeline.run_folder import RunFolder

if TYPE_CHECKING:
    import trimesh

    from room2dgs.primitives.primitive import Splats


def surface(scene: Scene, surfels: Splats | None, config: Config, run: RunFolder) -> MakeMesh:
    """Reconstructs the surface of the sparse points (`surface_of_points`); see `Mesher`."""
    from room2dgs.mesh.sparse_surface import surface_of_points

    points = find_points_alone(scene, config, run, depth_source="none")

    def make(settings: MeshConfig) -> trimesh.Trimesh:
        return surface_of_points(points, scene.train, settings, run.log)

    return make
