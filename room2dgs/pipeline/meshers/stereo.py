"""mesh.source=stereo: what stereo alone finds, fused: no prior, no completion, no training."""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import Config, MeshConfig
from room2dgs.pipeline.exposure import with_even_exposure
from room2dgs.pipeline.meshers.mesher import MakeMesh
from room2dgs.pipeline.mirrors import without_mirrored
from room2dgs.pipeline.points import find_points_alone
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.stereo import find_stereo, fused_stereo
from room2dgs.runs.folder import TRUST

if TYPE_CHECKING:
    import trimesh

    from room2dgs.primitives.primitive import Splats


def surface(scene: Scene, surfels: Splats | None, config: Config, run: RunFolder) -> MakeMesh:
    """Fuses the training views' stereo, as `room2dgs depth` makes it; see `Mesher`."""
    from room2dgs.mesh.fuse import fuse
    from room2dgs.runs.trust import read_trust, write_trust

    points = find_points_alone(scene, config, run, depth_source="stereo")
    stereo, share = find_stereo(scene, points, config, run)
    run.record({"stereo_coverage": round(share, 4)})
    found = {frame.name: view for frame, view in zip(scene.keyframes, stereo.views, strict=True)}
    maps = {name: ViewMaps(depth=view.depth, source="stereo") for name, view in found.items()}
    counts = {name: (view.depth, view.num_consistent) for name, view in found.items()}
    write_trust(run.path / TRUST, scene.keyframes, maps, counts)
    scene = with_even_exposure(scene, points, maps, config, run)

    def make(settings: MeshConfig) -> trimesh.Trimesh:
        views = without_mirrored(
            fused_stereo(scene.keyframes, stereo), scene, read_trust(run.path / TRUST), config, run
        )
        return fuse(views, settings, run.log, config.render.device)

    return make
