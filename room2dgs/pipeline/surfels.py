"""The surfels of a run, and their renderings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Frame
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.runs.folder import CONFIG, SURFELS, required, saved_settings

if TYPE_CHECKING:  # torch takes seconds to import
    from room2dgs.primitives.primitive import Splats
    from room2dgs.splat.types import Rendering


def load_run_surfels(out: Path) -> Splats:
    """The surfels of a run, in the scene's frame.

    Raises:
        InputError: it trained nothing, or not to the end, or the file is damaged.
    """
    from room2dgs.train import load_surfels

    return load_surfels(surfels_path(out))


def surfels_if_trained(config: Config) -> Splats | None:
    """The surfels of the run in config.out; None: its mesh is made without training.

    Raises:
        InputError: as `load_run_surfels`.
    """
    return load_run_surfels(Path(config.out)) if config.mesh.of_surfels else None


def surfels_path(out: Path) -> Path:
    """The file of a run's surfels.

    Raises:
        InputError: the run trained nothing, or not to the end.
    """
    if not (out / SURFELS).is_file() and (out / CONFIG).is_file():
        mesh = saved_settings(out).mesh
        if not mesh.of_surfels:
            raise InputError(
                f"{out} has no surfels: mesh.source={mesh.source} trains nothing; start another run without it, in "
                "another out=DIR"
            )
    return required(out / SURFELS, "train")


def use_threads(config: Config) -> None:
    """The kernels' threads from now on; torch and open3d keep their own."""
    from room2dgs.splat import set_threads

    set_threads(config.render.threads)


def render_frames(
    surfels: Splats, frames: Iterable[Frame], config: Config, device: str = "cpu"
) -> Iterator[tuple[Frame, Rendering]]:
    """Each view's rendering, one at a time, at the size that the run works at.

    Args:
        device: as `render.device`; the images stay where they are drawn.

    Raises:
        InputError: no GPU where one is asked for.
    """
    import torch

    from room2dgs.geometry.camera_tensors import view_matrices
    from room2dgs.primitives.registry import render
    from room2dgs.train.device import on_device, to_device

    with on_device(device) as where:
        there = to_device(surfels, where)
        background = to_device(torch.tensor(config.render.background, dtype=torch.float32), where)
    for frame in frames:
        camera = frame.camera
        K, cam_from_world = (to_device(matrix, where) for matrix in view_matrices(camera))
        with on_device(device), torch.no_grad():  # around the call alone: a generator would leave it on in its caller
            view = render(
                there,
                K,
                cam_from_world,
                camera.width,
                camera.height,
                background=background,
                near_m=config.render.near_m,
            )
        yield frame, view
