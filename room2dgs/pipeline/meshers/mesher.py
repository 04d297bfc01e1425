"""What a mesher is."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from room2dgs.captures.scene import Scene
from room2dgs.config import Config, MeshConfig
from room2dgs.pipeline.run_folder import RunFolder

if TYPE_CHECKING:
    import trimesh

    from room2dgs.primitives.primitive import Splats

MakeMesh = Callable[[MeshConfig], "trimesh.Trimesh"]


class Mesher(Protocol):
    """Makes ready what a mesh is made of, and returns what makes the mesh."""

    def __call__(self, scene: Scene, surfels: Splats | None, config: Config, run: RunFolder) -> MakeMesh:
        """Make ready.

        Args:
            scene: the capture with the poses of the run, its frame, metres.
            surfels: trained; None if the mesher's registry entry says that it trains nothing.
            config: all settings.
            run: where figures and the log go.

        Returns:
            From the mesh settings, with a voxel size in any case, to the mesh in the scene's frame.

        Raises:
            InputError: the capture has not what this mesher needs; also from the function that is returned.
        """
        ...
