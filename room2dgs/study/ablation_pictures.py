"""The meshes of an ablation side by side: the same cameras, the same colour scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from room2dgs.captures.scene import Scene
from room2dgs.eval.pictures import COLUMNS, inside_rows, top_row, write_sheet
from room2dgs.eval.surface import Surface
from room2dgs.geometry.up_axis import up_axis
from room2dgs.mesh.world import read_in_scene
from room2dgs.report.page import in_drawing
from room2dgs.study.ablation import Study

ERROR = 1  # index of the error's picture in COLUMNS


@dataclass
class MeshView:
    """One camera's view at every row's mesh.

    Attributes:
        title: where the camera is.
        photo: (H, W, 3) 0..1, None from above.
        tiles: row -> the pictures of COLUMNS, each (H, W, 3) 0..1.
    """

    title: str
    photo: np.ndarray | None = None
    tiles: dict[str, list[np.ndarray]] = field(default_factory=dict)


def mesh_views(meshes: Mapping[str, Path], gt: Path, scene: Scene, threshold_m: float) -> list[MeshView]:
    """A few of the capture's views, then the view from above, of each row's mesh.

    Args:
        meshes: row -> its mesh file.

    Raises:
        InputError: a mesh cannot be read.
    """
    gt_mesh = read_in_scene(gt, scene.origin_m)
    truth = Surface(gt_mesh)
    cameras = [frame.camera for frame in scene.frames]
    up = up_axis(cameras, truth.face_normals)
    inside: list[MeshView] = []
    above = MeshView("from above")
    for name, path in meshes.items():
        mesh = read_in_scene(path, scene.origin_m)
        surface = Surface(mesh)
        for number, (photo, *tiles) in enumerate(inside_rows(mesh, surface, truth, scene.frames, threshold_m)):
            if number == len(inside):
                inside.append(MeshView(f"view {number + 1}", photo))
            inside[number].tiles[name] = _light(tiles)
        above.tiles[name] = _light(top_row(mesh, surface, truth, gt_mesh, cameras, up, threshold_m))
    return [*inside, above]


def write_error_sheet(path: Path, views: Sequence[MeshView], study: Study) -> None:
    """The errors of all rows as one PNG: a line for each of the capture's views, a column for each row."""
    inside = [view for view in views if view.photo is not None]
    priors = {row.name: row.priors for row in study.rows}
    titles = [f"{in_drawing(name)}\npriors: {in_drawing(priors[name])}" for name in inside[0].tiles]
    lines = [[tiles[ERROR] for tiles in view.tiles.values()] for view in inside]
    write_sheet(path, lines, titles, study.threshold_m)


def _light(tiles: Sequence[np.ndarray]) -> list[np.ndarray]:
    """float16 keeps what a picture of 8 bits needs, in a quarter of the memory."""
    return [np.clip(tile, 0, 1).astype(np.float16) for tile in tiles[: len(COLUMNS)]]
