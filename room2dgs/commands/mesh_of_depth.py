"""A mesh of the depth that a run would train with: a first look, without any training."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.commands.stages import points_and_priors, use_threads
from room2dgs.commands.untrained import untrained_mesh
from room2dgs.config import Config, MeshConfig
from room2dgs.errors import InputError
from room2dgs.logs import Log

if TYPE_CHECKING:
    import trimesh

    from room2dgs.depth import Priors
    from room2dgs.mesh.views import FusedView


def mesh_of_depth(scene: Scene, config: Config, out: Path, log: Log, seconds: dict[str, float]) -> None:
    """mesh.ply of the training views' prior depth, its figures into metrics.json.

    Raises:
        InputError: no depth at all, no surface, or as `points_and_priors`.
    """
    from room2dgs.mesh.fuse import fuse

    use_threads(config)
    _, priors = points_and_priors(scene, config, out, log, seconds)
    if not any(maps.depth is not None for maps in priors.by_frame.values()):
        raise InputError("mesh.source=depth has no depth to mesh; give prior=room_prior, or mesh.source=surfels")

    def fused(settings: MeshConfig) -> trimesh.Trimesh:
        return fuse(trusted_views(scene, priors, config), settings, log, config.render.device)

    untrained_mesh(fused, "depth", scene, config, out, log, seconds)


def trusted_views(scene: Scene, priors: Priors, config: Config) -> Iterator[FusedView]:
    """The prior depth of the training views that have some, one at a time."""
    from room2dgs.mesh.views import trusted_view

    for frame in scene.train:
        maps = priors.by_frame.get(frame.name)
        if maps is not None and maps.depth is not None:
            yield trusted_view(maps, frame.camera, frame.color(), config.mesh)
