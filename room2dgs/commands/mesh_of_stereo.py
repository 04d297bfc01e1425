"""A mesh of what stereo alone finds: no prior, no completion, no training."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.commands.stages import use_threads
from room2dgs.commands.stereo_views import fused_views, stereo_views
from room2dgs.commands.untrained import points_alone, untrained_mesh
from room2dgs.config import Config, MeshConfig
from room2dgs.logs import Log
from room2dgs.runs.folder import TRUST
from room2dgs.runs.metrics import record

if TYPE_CHECKING:
    import trimesh


def mesh_of_stereo(scene: Scene, config: Config, out: Path, log: Log, seconds: dict[str, float]) -> None:
    """mesh.ply of the training views' stereo, as `room2dgs depth` makes it, its figures into metrics.json.

    Raises:
        InputError: too few points, no surface, or as `scene_stereo`.
    """
    from room2dgs.mesh.fuse import fuse
    from room2dgs.runs.trust import write_trust

    use_threads(config)
    points = points_alone(scene, config, out, log, seconds, "stereo")
    cameras, views, share = stereo_views(scene, points, config, log, seconds)
    record(out, {"stereo_coverage": round(share, 4)}, seconds)
    found = {frame.name: view for frame, view in zip(scene.keyframes, views, strict=True)}
    maps = {name: ViewMaps(depth=view.depth, source="stereo") for name, view in found.items()}
    write_trust(out / TRUST, scene.keyframes, maps, {name: (view.depth, view.agreeing) for name, view in found.items()})

    def fused(settings: MeshConfig) -> trimesh.Trimesh:
        return fuse(fused_views(scene.keyframes, cameras, views), settings, log, config.render.device)

    untrained_mesh(fused, "stereo's depth", scene, config, out, log, seconds)
