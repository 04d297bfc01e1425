"""mesh.source=surfels: the depth that trained surfels render, fused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.config import Config, MeshConfig
from room2dgs.pipeline.meshers.mesher import MakeMesh
from room2dgs.pipeline.mirrors import without_mirrored
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.surfels import render_frames
from room2dgs.runs.folder import TRUST

if TYPE_CHECKING:
    import trimesh

    from room2dgs.mesh.views import FusedView
    from room2dgs.primitives.primitive import Splats
    from room2dgs.runs.trust import Trust


def surface(scene: Scene, surfels: Splats | None, config: Config, run: RunFolder) -> MakeMesh:
    """Fuses the renderings of the training views; see `Mesher`."""
    from room2dgs.mesh.fuse import fuse

    assert surfels is not None
    trust = _trust(scene, config, run)
    views = without_mirrored(_RenderedViews(scene, surfels, config, trust), scene, trust, config, run)

    def make(settings: MeshConfig) -> trimesh.Trimesh:
        return fuse(views, settings, run.log, config.render.device)

    return make


def _trust(scene: Scene, config: Config, run: RunFolder) -> dict[str, Trust]:
    """Training view -> how far its prior depth is trusted; nothing where no prior was read."""
    from room2dgs.runs.trust import read_trust

    if config.prior.depth.source == "none":
        return {}
    trust = read_trust(run.path / TRUST)
    known = sum(frame.name in trust for frame in scene.train)
    if known < len(scene.train) and config.mesh.max_expected_m is not None:
        run.log(
            f"mesh: {TRUST} says of {known} of {len(scene.train)} views how far off depth is to be expected; "
            "all that the others see is meshed"
        )
    return trust


@dataclass(frozen=True)
class _RenderedViews:
    """The training views, rendered each time they are gone through."""

    scene: Scene
    surfels: Splats
    config: Config
    trust: Mapping[str, Trust]

    def __iter__(self) -> Iterator[FusedView]:
        import numpy as np

        from room2dgs.mesh.views import fused_view

        for frame, rendering in render_frames(self.surfels, self.scene.train, self.config, self.config.render.device):
            known = self.trust.get(frame.name)
            confidence = None if known is None else known.confidence.astype(np.float32) / 255
            yield fused_view(rendering, frame.camera, self.config.mesh, confidence)
