"""The textured mesh of a run: mesh.glb."""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.pipeline.export import source_of
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.folder import TEXTURED

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats


def write_textured_mesh(scene: Scene, surfels: Splats | None, config: Config, run: RunFolder) -> None:
    """mesh.glb of the run's mesh.ply, unless export.textured is false: what `export to=textured` writes.

    Args:
        surfels: trained ones; None if the mesher trains nothing.
    """
    if not config.export.textured:
        return
    from room2dgs.export.texture.write import write_textured_glb

    source = source_of(config, run.log)
    source.scene = scene
    if surfels is not None:
        source.surfels = surfels
    with run.timed("texture"):
        (path,) = write_textured_glb(source, run.path / TEXTURED)
    run.record({"textured_mb": round(path.stat().st_size / 1e6, 2)})
    run.log(f"textured mesh: {path}, for every program that shows GLB files")
