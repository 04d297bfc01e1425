"""`room2dgs mesh`: a run's surfels to its mesh.ply."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.stages import read, rendered, trained_surfels, use_threads, with_poses_of_run
from room2dgs.commands.units import unit_named
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.logs import Log, run_log
from room2dgs.runs.folder import MESH, TRUST, at_work, earlier_run, keep_settings
from room2dgs.runs.metrics import MESH_SCORES, record, stale, timed

if TYPE_CHECKING:
    from room2dgs.mesh.views import FusedView
    from room2dgs.runs.trust import Trust
    from room2dgs.splat.types import Surfels

USAGE = "room2dgs mesh out=DIR [mesh.KEY=VALUE ...]"


def main(argv: list[str]) -> int:
    """Mesh an earlier run, with other settings than before if wanted."""
    if asked_for_help(argv):
        return show(USAGE, main.__doc__, ("mesh",))
    config = earlier_run(argv)
    if not config.mesh.of_surfels:
        source = f"mesh.source={config.mesh.source}"
        raise InputError(f"{source} is a run of its own; type room2dgs run scene.path=DIR {source}")
    with at_work(config) as out:
        surfels = trained_surfels(out)
        scene = with_poses_of_run(read(config), out)
        log = run_log(out)
        mesh_scene(scene, surfels, config, out, log, {})
        keep_settings(out, config, "mesh")
        log(f"next: room2dgs eval out={out}")
    return 0


def mesh_scene(scene: Scene, surfels: Surfels, config: Config, out: Path, log: Log, seconds: dict[str, float]) -> None:
    """mesh.ply from the depth of the training views, its figures into metrics.json."""
    from room2dgs.mesh.fuse import fuse
    from room2dgs.mesh.voxel import with_voxel
    from room2dgs.mesh.world import write_in_world
    from room2dgs.runs.kept_mesh import keep_mesh, mesh_is_kept, mesh_key

    use_threads(config)
    key = mesh_key(scene, config, out)
    if config.resume and mesh_is_kept(out, key):
        log(f"mesh: {out / MESH} is there from before")
        return
    settings = with_voxel(config.mesh, [frame.camera for frame in scene.train])
    with timed(seconds, "mesh"):
        trust = _trust(scene, config, out, log)
        with unit_named(scene, config, out):
            mesh = fuse(_Views(scene, surfels, config, trust), settings, log, config.render.device)
        write_in_world(out / MESH, mesh, scene.origin_m)
    # Scores of a mesh that is no longer there must not stand beside this one.
    faded = stale(out, MESH_SCORES)
    made = {"mesh_vertices": len(mesh.vertices), "mesh_faces": len(mesh.faces), "mesh_voxel_m": settings.voxel_m}
    record(out, {**faded, **made}, seconds)
    keep_mesh(out, key)
    log(f"mesh: {out / MESH}")


def _trust(scene: Scene, config: Config, out: Path, log: Log) -> dict[str, Trust]:
    """Training view -> how sure its prior depth is; nothing where nobody asks, or no prior was read."""
    from room2dgs.runs.trust import read_trust

    if config.mesh.max_expected_m is None or config.prior.depth.source == "none":
        return {}
    trust = read_trust(out / TRUST)
    known = sum(frame.name in trust for frame in scene.train)
    if known < len(scene.train):
        log(
            f"mesh: {TRUST} says of {known} of {len(scene.train)} views how far off depth is to be expected; "
            "all that the others see is meshed"
        )
    return trust


@dataclass(frozen=True)
class _Views:
    """The training views, rendered as they are gone through."""

    scene: Scene
    surfels: Surfels
    config: Config
    trust: Mapping[str, Trust]

    def __iter__(self) -> Iterator[FusedView]:
        import numpy as np

        from room2dgs.mesh.views import fused_view

        for frame, rendering in rendered(self.surfels, self.scene.train, self.config, self.config.render.device):
            known = self.trust.get(frame.name)
            confidence = None if known is None else known.confidence.astype(np.float32) / 255
            yield fused_view(rendering, frame.camera, self.config.mesh, confidence)
