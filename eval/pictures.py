"""Pictures of a mesh and of its error: from inside views, and from above without the ceiling."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import trimesh

from room2dgs.captures.scene import Frame
from room2dgs.captures.world_offset import AT_ORIGIN, Origin
from room2dgs.eval.scoring import Evaluation
from room2dgs.eval.shading import NOTHING, UNKNOWN, Rays, error_color, mesh_color, shade
from room2dgs.eval.surface import Surface
from room2dgs.files import whole_file
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.up_axis import up_axis
from room2dgs.mesh.vertex_source import EXPECTED_ERROR, told_by
from room2dgs.mesh.world import write_in_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INSIDE_VIEWS = 4  # evenly spaced in the capture
TILE_WIDTH = 480  # pixels of one picture
TOP_PIXELS = 700  # longer side of the picture from above
ABOVE_CAMERAS_M = 0.3  # what stands higher than this above the highest camera is cut off, seen from above
FULL_THRESHOLDS = 2.0  # the colour scale ends at so many thresholds (10 cm for 5 cm)
DPI, CELL_PX, GAP_PX, TITLE_INCHES = 130, 416, 6, 0.3  # of a sheet: a cell for each picture, a line of titles
COLUMNS = ("mesh", "error: mesh to truth", "missing: truth to mesh")
EXPECTED, EXPECTED_COLUMNS = "expected.png", ("photo", "expected error, one standard deviation", "true error")


def write_pictures(found: Evaluation, frames: Sequence[Frame], folder: Path, origin_m: Origin = AT_ORIGIN) -> None:
    """error.ply (the prediction coloured by its distance to the ground truth), views.png and top.png; expected.png
    where the prediction says how far off it is expected to be.

    Args:
        frames: the scene's, with photos; some are shown.
        origin_m: `Scene.origin_m`; error.ply lies in the capture's own world.
    """
    pred, gt, threshold = found.pred, found.gt, found.options.threshold_m
    cameras = [frame.camera for frame in frames]
    up = found.error_sites["up"] if found.error_sites else up_axis(cameras, gt.surface.face_normals)
    write_in_world(folder / "error.ply", error_mesh(pred.mesh, gt.surface, threshold), origin_m)
    rows = inside_rows(pred.mesh, pred.surface, gt.surface, frames, threshold)
    write_sheet(folder / "views.png", rows, ("photo", *COLUMNS), threshold)
    row = top_row(pred.mesh, pred.surface, gt.surface, gt.mesh, cameras, np.asarray(up), threshold)
    write_sheet(folder / "top.png", [row], COLUMNS, threshold)
    (folder / EXPECTED).unlink(missing_ok=True)  # of a mesh before
    expected = told_by(pred.mesh, EXPECTED_ERROR)
    if expected is not None:
        rows = expected_rows(expected, pred.surface, gt.surface, frames, threshold)
        write_sheet(folder / EXPECTED, rows, EXPECTED_COLUMNS, threshold)


def error_mesh(pred: trimesh.Trimesh, gt: Surface, threshold_m: float) -> trimesh.Trimesh:
    """The prediction with its vertices coloured by their distance to the ground truth."""
    distance, _ = gt.closest(np.asarray(pred.vertices))
    colors = np.round(error_color(distance, FULL_THRESHOLDS * threshold_m) * 255).astype(np.uint8)
    return trimesh.Trimesh(pred.vertices, pred.faces, vertex_colors=colors, process=False)


def inside_rows(
    pred: trimesh.Trimesh, pred_surface: Surface, gt: Surface, frames: Sequence[Frame], threshold_m: float
) -> list[list[np.ndarray]]:
    """A row of pictures (photo, then COLUMNS) for each of a few evenly spaced frames."""
    rows = []
    for frame in (frames[index] for index in inside(len(frames), INSIDE_VIEWS)):
        camera = frame.camera.resized_to_width(TILE_WIDTH)
        rows.append([frame.color() / 255, *_three(pred, pred_surface, gt, camera_rays(camera), threshold_m)])
    return rows


def expected_rows(
    expected: np.ndarray, surface: Surface, gt: Surface, frames: Sequence[Frame], threshold_m: float
) -> list[list[np.ndarray]]:
    """A row of `EXPECTED_COLUMNS` for each of a few evenly spaced frames.

    Args:
        expected: (V,) metres, of the vertices of the mesh that `surface` is of.
    """
    full, rows = FULL_THRESHOLDS * threshold_m, []
    for frame in (frames[index] for index in inside(len(frames), INSIDE_VIEWS)):
        rays = camera_rays(frame.camera.resized_to_width(TILE_WIDTH))
        hits = surface.cast(rays.origins, rays.directions)
        found = hits.triangle >= 0
        second, third = hits.uv[found].T
        corners = expected[surface.faces[hits.triangle[found]]]
        told = (np.stack([1 - second - third, second, third], axis=1) * corners).sum(axis=1)
        true = gt.closest(rays.at(hits))[0]
        pictures = (shade(rays, hits, surface, error_color(values, full)) for values in (told, true))
        rows.append([frame.color() / 255, *pictures])
    return rows


def inside(count: int, wanted: int) -> list[int]:
    """Places of so many evenly spaced items, first and last left out where there are enough."""
    return [int(index) for index in np.unique(np.linspace(0, count - 1, wanted + 2).astype(int)[1:-1])]


def top_row(
    pred: trimesh.Trimesh,
    pred_surface: Surface,
    gt: Surface,
    gt_mesh: trimesh.Trimesh,
    cameras: Sequence[Camera],
    up: np.ndarray,
    threshold_m: float,
) -> list[np.ndarray]:
    """The COLUMNS seen from above by parallel rays that start above the highest camera, below the ceiling."""
    rays = _top_rays(np.asarray(gt_mesh.vertices), cameras, up)
    return _three(pred, pred_surface, gt, rays, threshold_m, mask=False)


def write_sheet(path: Path, rows: Sequence[Sequence[np.ndarray]], titles: Sequence[str], threshold_m: float) -> None:
    """Rows of pictures with titles and the error's colour bar, as a PNG that appears whole or not at all."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    figure = new_sheet(rows, titles, below=0.9)
    tall = figure.get_figheight()
    figure.colorbar(
        ScalarMappable(
            Normalize(0, FULL_THRESHOLDS * threshold_m * 100),
            ListedColormap(error_color(np.linspace(0, 1, 256), 1.0)),
        ),
        cax=figure.add_axes((0.3, 0.55 / tall, 0.4, 0.15 / tall)),
        orientation="horizontal",
        extend="max",
        label="distance, cm (grey: no ground truth)",
    )
    with whole_file(path) as temporary:
        figure.savefig(temporary, format="png")


def new_sheet(rows: Sequence[Sequence[np.ndarray]], titles: Sequence[str], below: float = 0.05) -> Figure:
    """Rows of pictures with a title above each column.

    Args:
        below: inches that are left free under them.
    """
    from matplotlib.figure import Figure

    height, width = rows[0][-1].shape[:2]
    cell = CELL_PX, max(1, round(CELL_PX * height / width))
    wide, tall = len(titles) * cell[0], len(rows) * cell[1] + round((TITLE_INCHES + below) * DPI)
    figure = Figure(figsize=(wide / DPI, tall / DPI), dpi=DPI)
    for number, row in enumerate(rows):
        for column, picture in enumerate(row):
            # without axes, which cost more than the pictures
            pixels = fitted(picture, (cell[0] - GAP_PX, cell[1] - GAP_PX))
            x = column * cell[0] + (cell[0] - pixels.shape[1]) // 2
            y = round(below * DPI) + (len(rows) - 1 - number) * cell[1] + (cell[1] - pixels.shape[0]) // 2
            figure.figimage(pixels, x, y, origin="upper")
    for column, title in enumerate(titles):
        place = (column + 0.5) / len(titles), 1 - TITLE_INCHES / 2 / (tall / DPI)
        figure.text(*place, title, ha="center", va="center", fontsize=9 if len(title) < 40 else 6)
    return figure


def fitted(picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """The picture, 0..1, as large as fits into so many pixels (width, height)."""
    scale = min(size[0] / picture.shape[1], size[1] / picture.shape[0])
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    target = tuple(max(1, int(scale * side)) for side in picture.shape[1::-1])
    return np.clip(cv2.resize(picture.astype(np.float32), target, interpolation=how), 0, 1)


def _three(
    pred: trimesh.Trimesh,
    pred_surface: Surface,
    gt: Surface,
    rays: Rays,
    threshold_m: float,
    mask: bool = True,
) -> list[np.ndarray]:
    full = FULL_THRESHOLDS * threshold_m
    pred_hits = pred_surface.cast(rays.origins, rays.directions)
    gt_hits = gt.cast(rays.origins, rays.directions)
    wrong = error_color(gt.closest(rays.at(pred_hits))[0], full)
    missing = error_color(pred_surface.closest(rays.at(gt_hits))[0], full)
    error = shade(rays, pred_hits, pred_surface, wrong)
    if mask:  # no ground truth along these rays
        unknown = rays.picture(np.repeat((gt_hits.triangle < 0)[:, None], 3, axis=1))
        error = np.where(unknown, UNKNOWN, error)
    empty = NOTHING if not mask else UNKNOWN
    missed = shade(rays, gt_hits, gt, missing)
    missed[rays.picture(np.repeat((gt_hits.triangle < 0)[:, None], 3, axis=1)).all(axis=-1)] = empty
    return [shade(rays, pred_hits, pred_surface, mesh_color(pred, pred_hits)), error, missed]


def camera_rays(camera: Camera) -> Rays:
    """The rays through a camera's pixels."""
    return Rays(camera.centre, camera.world_rays().reshape(-1, 3), camera.width, camera.height)


def _top_rays(points: np.ndarray, cameras: Sequence[Camera], up: np.ndarray) -> Rays:
    """Parallel rays downwards over the points' extent; the picture's x axis is the extent's longer side."""
    level = points - np.outer(points @ up, up)
    axes = np.linalg.svd(level[:: max(1, len(level) // 5000)] - level.mean(axis=0), full_matrices=False)[2]
    right = axes[0] - (axes[0] @ up) * up
    right /= np.linalg.norm(right)
    down_in_picture = np.cross(-up, right)
    x, y = points @ right, points @ down_in_picture
    size = max(np.ptp(x), np.ptp(y)) / TOP_PIXELS
    columns, rows = max(1, int(np.ceil(np.ptp(x) / size))), max(1, int(np.ceil(np.ptp(y) / size)))
    grid_x, grid_y = np.meshgrid(x.min() + (np.arange(columns) + 0.5) * size, y.min() + (np.arange(rows) + 0.5) * size)
    start = max(float(camera.centre @ up) for camera in cameras) + ABOVE_CAMERAS_M
    origins = grid_x.reshape(-1, 1) * right + grid_y.reshape(-1, 1) * down_in_picture + start * up
    return Rays(origins, np.broadcast_to(-up, origins.shape), columns, rows)
