"""mesh.source=depth: the depth that a run would train with, fused: a first look, without any training."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.config import Config, MeshConfig
from room2dgs.errors import InputError
from room2dgs.pipeline.depth import points_and_priors
from room2dgs.pipeline.exposure import with_even_exposure
from room2dgs.pipeline.meshers.mesher import MakeMesh
from room2dgs.pipeline.mirrors import without_mirrored
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.folder import TRUST

if TYPE_CHECKING:
    import trimesh

    from room2dgs.depth import Priors
    from room2dgs.mesh.views import FusedView
    from room2dgs.primitives.primitive import Splats


def surface(scene: Scene, surfels: Splats | None, config: Config, run: RunFolder) -> MakeMesh:
    """Fuses the prior depth of the training views; see `Mesher`."""
    from room2dgs.mesh.fuse import fuse
    from room2dgs.runs.trust import read_trust

    points, priors = points_and_priors(scene, config, run)
    if not any(maps.depth is not None for maps in priors.by_frame.values()):
        raise InputError("mesh.source=depth has no depth to mesh; give prior=room_prior, or mesh.source=surfels")

    scene = with_even_exposure(scene, points, priors.by_frame, config, run)

    def make(settings: MeshConfig) -> trimesh.Trimesh:
        views = without_mirrored(
            views_with_depth(scene, priors, config), scene, read_trust(run.path / TRUST), config, run
        )
        return fuse(views, settings, run.log, config.render.device)

    return make


def views_with_depth(scene: Scene, priors: Priors, config: Config) -> Iterator[FusedView]:
    """The prior depth of the training views that have some, one at a time."""
    from room2dgs.mesh.views import trusted_view

    for frame in scene.train:
        maps = priors.by_frame.get(frame.name)
        if maps is not None and maps.depth is not None:
            yield trusted_view(maps, frame.camera, frame.levelled_color(), config.mesh)
