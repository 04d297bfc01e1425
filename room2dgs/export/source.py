"""What exports draw from: a run's surfels, mesh, views and points, each read when first asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from room2dgs import __version__
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.world_offset import AT_ORIGIN, Origin
from room2dgs.config import Config
from room2dgs.export.axes import turned, up_of, y_down_from, y_up_from, z_up_from
from room2dgs.logs import Log
from room2dgs.mesh.vertex_source import with_nearest_error
from room2dgs.primitives.primitive import Splats
from room2dgs.primitives.registry import primitive_of
from room2dgs.splat.types import Rendering

if TYPE_CHECKING:
    from room2dgs.export.texture.write import Textured


@dataclass
class Source:
    """A finished run.

    Attributes:
        folder: the run's.
        config: its settings, `export` among them.
        read_scene, read_surfels, read_mesh, read_points: give its parts; called once at most. The mesh is read into the
            frame of a scene with this origin.
        render: views of the surfels, one at a time.
        log: takes one line at a time.
        recorded_origin_m: `Scene.origin_m` as the run noted it; None: the capture is read for it.
    """

    folder: Path
    config: Config
    read_scene: Callable[[], Scene]
    read_surfels: Callable[[], Splats]
    read_mesh: Callable[[Origin], trimesh.Trimesh]
    read_points: Callable[[Scene], PointCloud]
    render: Callable[[Splats, Iterable[Frame]], Iterator[tuple[Frame, Rendering]]]
    log: Log = print
    recorded_origin_m: Origin | None = None

    @cached_property
    def scene(self) -> Scene:
        """The capture, with the poses of the run."""
        return self.read_scene()

    @cached_property
    def surfels(self) -> Splats:
        return self.read_surfels()

    @property
    def origin_m(self) -> Origin:
        """Where the origin of the scene's frame stands in the capture's world, metres."""
        return self.scene.origin_m if self.recorded_origin_m is None else self.recorded_origin_m

    def offset_m(self, rotation: np.ndarray) -> np.ndarray:
        """(3,) what puts a turned scene back into the turned world; zeros for a scene at its world's origin.

        Args:
            rotation: (3, 3) from the capture's world to the file's frame.
        """
        return rotation @ np.array(self.origin_m) + 0.0

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """The run's whole mesh, scene's frame."""
        return self.read_mesh(self.origin_m)

    @cached_property
    def points(self) -> PointCloud:
        """The sparse points that the run was seeded with."""
        return self.read_points(self.scene)

    @cached_property
    def hand_over(self) -> trimesh.Trimesh:
        """The mesh with as few faces as export.faces and export.max_error_m ask for; scene's frame."""
        from room2dgs.mesh.simplify import simplified

        settings = self.config.export
        if settings.faces is None and settings.max_error_m is None:
            return self.mesh
        result = simplified(self.mesh, settings.faces, settings.max_error_m)
        self.log(f"mesh: {len(self.mesh.faces):,} faces to {len(result.mesh.faces):,}, {result.sentence}")
        return with_nearest_error(result.mesh, self.mesh)

    @cached_property
    def textured(self) -> Textured:
        """The mesh with few faces and a picture on it."""
        from room2dgs.export.texture.write import textured

        return textured(self)

    @cached_property
    def up(self) -> np.ndarray | None:
        """(3,) unit, world; None: nothing is to be turned."""
        setting = self.config.export.up
        cameras = [frame.camera for frame in self.scene.frames] if setting == "auto" else []
        return up_of(setting, cameras, self._normals() if setting == "auto" else np.zeros((0, 3)))

    @property
    def y_up(self) -> np.ndarray:
        """(3, 3) rotation from the world to the frame of glTF, OBJ and SPZ."""
        return y_up_from(self.up)

    @property
    def y_down(self) -> np.ndarray:
        """(3, 3) rotation from the world to the frame of PLY and .splat files."""
        return y_down_from(self.up)

    @property
    def z_up(self) -> np.ndarray:
        """(3, 3) rotation from the world to the frame of STL files."""
        return z_up_from(self.up)

    @cached_property
    def surfels_y_down(self) -> Splats:
        return turned(self.surfels, self.y_down)

    def comments(self, rotation: np.ndarray, local: bool = True) -> list[str]:
        """What a file says about itself.

        Args:
            rotation: (3, 3) from the capture's world to the file's frame.
            local: its coordinates count from the scene's origin.
        """
        far = self.origin_m != AT_ORIGIN
        digits = ".17g" if far else ".9g"  # thousands of kilometres are turned by it
        numbers = " ".join(f"{value:{digits}}" for value in rotation.ravel())
        lines = [f"room2dgs {__version__}, metres", f"file_from_world (rows of the rotation) {numbers}"]
        if far and local:
            lines.append("offset " + " ".join(f"{value:.17g}" for value in self.offset_m(rotation)))
        return lines

    def _normals(self) -> np.ndarray:
        """(N, 3) unit, of surfels; of the mesh where nothing was trained."""
        if not self.config.mesh.of_surfels:
            return np.asarray(self.mesh.face_normals)
        return primitive_of(self.surfels).normals(self.surfels).double().numpy()
