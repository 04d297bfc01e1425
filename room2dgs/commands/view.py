"""`room2dgs view`: walk through an earlier run."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.commands.own_arguments import own_arguments, whole_number
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.stages import read, trained_surfels, use_threads, with_poses_of_run
from room2dgs.config import Config
from room2dgs.runs.folder import MESH, earlier_run, required

if TYPE_CHECKING:
    from room2dgs.runs.page.mesh_views import DrawnMesh
    from room2dgs.viewer.server import Viewer

USAGE = "room2dgs view run=DIR [host=127.0.0.1[,NAME,...]] [port=8080] [fps=15]"
OWN = ("host", "port", "fps")
PHOTO_WIDTH = 160  # pixels of the photos in the cameras' frames
CAMERAS = 120  # at most, evenly spaced
CAMERA_SIZE = 0.02  # of twice the extent of the cameras
FACES = 150_000
SEED_M = 0.015


def main(argv: list[str]) -> int:
    """Serve an earlier run to a browser on this machine until Ctrl-C: walk through it; switch between colour, depth,
    normals, mesh and error; show seeds, cameras and their photos; measure between two clicked points.

    A run that trained nothing (mesh.source=depth, stereo or points) shows its mesh instead of surfels.

    The address that is printed holds a token; who does not have it is not let in. host= lets others look: without it
    nobody but this machine can; host=0.0.0.0,NAME names what browsers elsewhere call this machine. Needs viser: pip
    install 'room2dgs[view]'.
    """
    if asked_for_help(argv):
        return show(USAGE, main.__doc__, ("render",))
    from room2dgs.viewer.server import LOOPBACK, warn_of_host

    own, overrides = own_arguments(argv, OWN)
    config = earlier_run(overrides)
    host = own.get("host") or LOOPBACK
    fps = whole_number(own, "fps", 15, 1, 60)
    viewer = viewer_of(config, host, whole_number(own, "port", 8080, 1, 65535), fps)
    try:
        viewer.start()
        warn_of_host(host, print)
        # on a line of its own: terminals take what follows an address for part of it
        print(f"look at {viewer.url}\nCtrl-C ends it", flush=True)
        threading.Event().wait()
    finally:
        viewer.stop()
    return 0


def viewer_of(config: Config, host: str, port: int, fps: float) -> Viewer:
    """A viewer with all that a run has to show.

    Raises:
        InputError: the run is not trained to the end, or has no mesh if it trains nothing; or viser is missing.
    """
    from room2dgs.geometry.up_axis import up_axis
    from room2dgs.train import checkpoint
    from room2dgs.viewer.server import Viewer

    out = Path(config.out)
    surfels = trained_surfels(out) if config.mesh.of_surfels else None
    mesh = required(out / MESH, "run") if surfels is None else out / MESH
    scene = with_poses_of_run(read(config), out)
    shown = _drawn(mesh, scene) if surfels is None else surfels
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
    except BaseException:
        viewer.stop()
        raise
    return viewer


def _drawn(mesh: Path, scene: Scene) -> DrawnMesh:
    """Of a run that trains nothing."""
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.runs.page.mesh_views import DrawnMesh

    return DrawnMesh(read_in_scene(mesh, scene.origin_m))


def _add_meshes(viewer: Viewer, mesh: Path, scene: Scene) -> None:
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.runs.page.mesh_layer import solid, with_error
    from room2dgs.viewer.server import ERROR
    from room2dgs.viewer.server import MESH as SHOWN_MESH

    if not mesh.is_file():
        return
    room = with_error(solid(read_in_scene(mesh, scene.origin_m), FACES), mesh.parent, scene.origin_m)
    for name, layer in ((SHOWN_MESH, "color"), (ERROR, "error")):
        if layer in room.layers:
            viewer.add_mesh(name, room.vertices, room.faces, room.layers[layer])


def _add_cameras(viewer: Viewer, scene: Scene) -> None:
    frames: Sequence[Frame] = evenly_spaced(scene.frames, CAMERAS)
    photos = [_small(frame.color()) for frame in frames]
    viewer.add_cameras([frame.camera for frame in frames], photos, CAMERA_SIZE * scene.extent * 2)


def _small(photo: np.ndarray) -> np.ndarray:
    height = max(1, round(photo.shape[0] * PHOTO_WIDTH / photo.shape[1]))
    return cv2.resize(photo, (PHOTO_WIDTH, height), interpolation=cv2.INTER_AREA)
