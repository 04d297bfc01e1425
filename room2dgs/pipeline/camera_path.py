"""Pictures, raw depth and a video of what cameras see along a path through a run."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.export.depth_maps import TooFar, as_npy, in_millimetres
from room2dgs.files import whole_file
from room2dgs.geometry.camera import Camera
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.surfels import render_frames, use_threads
from room2dgs.runs.folder import RENDERS
from room2dgs.runs.pictures import normal_picture, write_png

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats
    from room2dgs.splat.types import Rendering

SAVED = ("color", "depth", "depth_npy", "normals", "video")
SMOOTH, VIDEO = "smooth", "video.mp4"
# What OpenCV may be able to write, the best first: VP9 and H.264 play in browsers, MPEG-4 in players of videos alone.
CODECS = ("vp09", "avc1", "mp4v")


class PathOptions(NamedTuple):
    """Which path to render, and what to write of it.

    Attributes:
        path: "smooth", or a camera file.
        to: folder; None: in the run's.
        save: of `SAVED`.
        frames, through: of the smooth path: pictures, and captured views that it passes.
        fps: of the video.
        width: pixels; None: as the cameras have it.
    """

    path: str = SMOOTH
    to: Path | None = None
    save: tuple[str, ...] = ("color", "video")
    frames: int = 240
    through: int = 12
    fps: int = 30
    width: int | None = None


def render_path(options: PathOptions, scene: Scene, surfels: Splats, config: Config, run: RunFolder) -> Path:
    """Writes NAME.png, NAME.depth.png, NAME.depth.npy, NAME.normals.png and video.mp4, as `options.save` says.

    Returns:
        Their folder.

    Raises:
        InputError: a camera file that cannot be used, or a folder that cannot be written.
    """
    from room2dgs.train.progress import Bar

    frames = path_frames(options, scene)
    name = SMOOTH if options.path == SMOOTH else Path(options.path).stem
    folder = options.to or run.path / RENDERS / name
    sizes = {frame.camera.size for frame in frames}
    if "video" in options.save and len(sizes) > 1:
        raise InputError(f"{options.path} has pictures of several sizes, a video has one; leave video out of save=")
    use_threads(config)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror}); choose another to=DIR") from error
    bar, far = Bar(len(frames), 0), TooFar()
    try:
        with _video(folder / VIDEO, frames[0].camera.size, options) as add:
            for done, (frame, view) in enumerate(render_frames(surfels, frames, config), start=1):
                color = np.round(view.color.clamp(0, 1).numpy() * 255).astype(np.uint8)
                _write(folder, frame, view, color, options.save, far)
                add(color)
                bar.update(done, f"{frame.name}")
    finally:
        bar.stop()
    far.log_to(run.log, "save=depth_npy")
    run.log(f"renders: {len(frames)} views ({', '.join(options.save)}) in {folder}")
    return folder


def path_frames(options: PathOptions, scene: Scene) -> list[Frame]:
    """The path's cameras as frames without photos, each with a name of its own.

    Raises:
        InputError: a camera file that cannot be used.
    """
    if options.path == SMOOTH:
        from room2dgs.geometry.camera_path import smooth_path

        found = smooth_path([frame.camera for frame in scene.frames], options.frames, options.through)
        named = [(f"{index:05d}", camera) for index, camera in enumerate(found)]
    else:
        from room2dgs.captures.camera_file import read_cameras
        from room2dgs.captures.world_offset import camera_in_scene

        named = read_cameras(Path(options.path).expanduser().absolute())
        named = [(name, camera_in_scene(camera, scene.origin_m)) for name, camera in named]
        if len({name for name, _ in named}) < len(named):
            named = [(f"{index:05d}", camera) for index, (_, camera) in enumerate(named)]
    return [Frame(name, _sized(camera, options.width), Path(name)) for name, camera in named]


def _sized(camera: Camera, width: int | None) -> Camera:
    return camera if width is None else camera.resized_to_width(width)


def _write(folder: Path, frame: Frame, view: Rendering, color: np.ndarray, save: tuple[str, ...], far: TooFar) -> None:
    depth = view.covered_depth().numpy()
    if "color" in save:
        write_png(folder / f"{frame.name}.png", color)
    if "depth" in save:
        write_png(folder / f"{frame.name}.depth.png", in_millimetres(depth, far))
    if "depth_npy" in save:
        with whole_file(folder / f"{frame.name}.depth.npy") as temporary:
            temporary.write_bytes(as_npy(depth))
    if "normals" in save:
        picture = normal_picture(view.normal.numpy(), frame.camera, view.covered.numpy())
        write_png(folder / f"{frame.name}.normals.png", picture)


@contextmanager
def _video(path: Path, size: tuple[int, int], options: PathOptions) -> Iterator:
    """Gives what adds a picture to the video, which is there whole at the end or not at all."""
    if "video" not in options.save:
        yield lambda color: None
        return
    even = size[0] // 2 * 2, size[1] // 2 * 2  # the colours of a video are half as fine
    temporary = path.with_name(f".{os.getpid()}.{path.name}")  # OpenCV tells the format by the name's end
    writer = _opened_writer(temporary, options.fps, even)
    try:
        if not writer.isOpened():
            raise InputError(f"{path} cannot be written as MP4 by this OpenCV; leave video out of save=")
        yield lambda color: writer.write(np.ascontiguousarray(color[: even[1], : even[0], ::-1]))
        writer.release()
        temporary.replace(path)
    finally:
        writer.release()
        temporary.unlink(missing_ok=True)


def _opened_writer(path: Path, fps: int, size: tuple[int, int]) -> cv2.VideoWriter:
    """With the first of `CODECS` that this OpenCV has; not opened if it has none."""
    writer = cv2.VideoWriter()
    for codec in CODECS:
        if writer.open(str(path), cv2.VideoWriter.fourcc(*codec), fps, size):
            break
    return writer
