"""A viewer of an earlier run."""

from __future__ import annotations

import shlex
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.config import Config
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.saved_path import PATH, write_path
from room2dgs.pipeline.scene import scene_of_run
from room2dgs.pipeline.surfels import surfels_if_trained, use_threads
from room2dgs.runs.folder import MESH, TEXTURED, required
from room2dgs.runs.page.cameras import camera_size_m

if TYPE_CHECKING:
    from room2dgs.geometry.camera import Camera
    from room2dgs.primitives.primitive import Splats
    from room2dgs.runs.page.mesh_views import DrawnMesh
    from room2dgs.viewer.server import Box, Viewer

PHOTO_WIDTH = 160  # pixels of the photos in the cameras' frames
CAMERAS = 120  # at most, evenly spaced
FACES = 150_000
SEED_M = 0.015


def viewer_of(config: Config, host: str, port: int, fps: float) -> Viewer:
    """A viewer with all that a run has to show.

    Raises:
        InputError: the run is not trained to the end, or has no mesh if it trains nothing; or viser is missing.
    """
    from room2dgs.geometry.up_axis import up_axis
    from room2dgs.train import checkpoint
    from room2dgs.viewer.server import Viewer

    out = Path(config.out)
    surfels = surfels_if_trained(config)
    mesh = required(out / MESH, "run") if surfels is None else out / MESH
    scene = scene_of_run(config)
    shown = _drawn_mesh(mesh, scene) if surfels is None else surfels
    use_threads(config)
    up = up_axis([frame.camera for frame in scene.frames], np.zeros((0, 3)))
    viewer = Viewer(shown, up, host, port, fps, config.render.near_m)
    try:
        viewer.look_from(scene.frames[0].camera)
        _add_meshes(viewer, mesh, scene)
        state = checkpoint.latest(out, print)
        if state is not None and "positions" in state.fixed:
            viewer.add_seeds(state.fixed["positions"].numpy(), SEED_M)
        _add_cameras(viewer, scene)
        if surfels is not None:
            viewer.add_crop_box(*_box_of(surfels))
        _add_saving(viewer, scene, surfels, config)
    except BaseException:
        viewer.stop()
        raise
    return viewer


def _drawn_mesh(mesh: Path, scene: Scene) -> DrawnMesh:
    """Of a run that trains nothing."""
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.runs.page.mesh_views import DrawnMesh

    return DrawnMesh(read_in_scene(mesh, scene.origin_m))


def _add_meshes(viewer: Viewer, mesh: Path, scene: Scene) -> None:
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.runs.page.mesh_layer import page_mesh, with_error
    from room2dgs.viewer.server import ERROR
    from room2dgs.viewer.server import MESH as SHOWN_MESH

    if not mesh.is_file():
        return
    room = with_error(page_mesh(read_in_scene(mesh, scene.origin_m), FACES), mesh.parent, scene.origin_m)
    for name, layer in ((SHOWN_MESH, "color"), (ERROR, "error")):
        if layer in room.layers:
            viewer.add_mesh(name, room.vertices, room.faces, room.layers[layer])


def _add_cameras(viewer: Viewer, scene: Scene) -> None:
    frames: Sequence[Frame] = evenly_spaced(scene.frames, CAMERAS)
    cameras = [frame.camera for frame in frames]
    photos = [_thumbnail(frame.color()) for frame in frames]
    viewer.add_cameras([frame.name for frame in frames], cameras, photos, camera_size_m(cameras))


def _box_of(splats: Splats) -> tuple[np.ndarray, np.ndarray]:
    """(3,) corners of the box that holds all finite centres."""
    centers = splats.centers.detach().double().numpy()
    known = centers[np.isfinite(centers).all(axis=1)]
    return (known.min(axis=0), known.max(axis=0)) if len(known) else (np.zeros(3), np.ones(3))


def _add_saving(viewer: Viewer, scene: Scene, surfels: Splats | None, config: Config) -> None:
    out = Path(config.out)
    readers: dict[str, Callable[[Box], bytes]] = {
        TEXTURED: lambda box: _cropped_glb(scene, surfels, config, box),
        MESH: lambda box: _cropped_ply(scene, out, box),
    }

    def reader(name: str) -> Callable[[Box | None], bytes]:
        return lambda box: (out / name).read_bytes() if box is None else readers[name](box)

    def save_path(views: list[Camera]) -> str:
        try:
            count = write_path(views, scene.origin_m, out / PATH)
        except OSError as error:
            return f"{PATH} cannot be written ({error.strerror})."
        return f"{count} pictures: `room2dgs render {shlex.quote(out.name)} path={shlex.quote(f'{out.name}/{PATH}')}`"

    record = None if surfels is None else partial(_recorded, scene, surfels, config)
    viewer.add_saving({name: reader(name) for name in readers if (out / name).is_file()}, save_path, record)


def _cropped_ply(scene: Scene, out: Path, box: Box) -> bytes:
    from room2dgs.export.cropped import cropped_ply

    return cropped_ply(out / MESH, box, scene.origin_m)


def _cropped_glb(scene: Scene, surfels: Splats | None, config: Config, box: Box) -> bytes:
    from room2dgs.export.cropped import cropped_glb
    from room2dgs.pipeline.export import source_of

    source = source_of(config, print)
    source.scene = scene
    if surfels is not None:
        source.surfels = surfels
    return cropped_glb(Path(config.out) / TEXTURED, box, source.y_up, source.offset_m(source.y_up))


def _recorded(scene: Scene, surfels: Splats, config: Config, views: list[Camera]) -> bytes:
    """The video that `room2dgs render path=` makes of the path through these views; nothing is left on the disk."""
    from room2dgs.pipeline.camera_path import VIDEO, PathOptions, render_path

    with tempfile.TemporaryDirectory() as folder:
        path, to = Path(folder) / PATH, Path(folder) / "video"
        write_path(views, scene.origin_m, path)
        render_path(
            PathOptions(str(path), to, ("video",)), scene, surfels, config, RunFolder(to, lambda _: None, bar=False)
        )
        return (to / VIDEO).read_bytes()


def _thumbnail(photo: np.ndarray) -> np.ndarray:
    height = max(1, round(photo.shape[0] * PHOTO_WIDTH / photo.shape[1]))
    return cv2.resize(photo, (PHOTO_WIDTH, height), interpolation=cv2.INTER_AREA)
