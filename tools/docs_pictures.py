"""The pictures of the documentation, drawn from a finished run.

`python -m room2dgs.tools.docs_pictures demo/room demo/run docs/images` after `make demo`.

It writes `hero.jpg` (photos beside the mesh, seen from outside), `error.jpg` (a view with the errors of the mesh) and
`held_out.jpg` (a photo, its rendering, depth and normals). The others are screenshots.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import trimesh

from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.files import whole_file
from room2dgs.mesh.open3d import o3c_tensor, o3d

WIDTH, HEIGHT, OVERSAMPLED = 900, 680, 2
CUT_M = 1.2  # what lies farther towards the eye is cut off: it would hide the room
LIGHT = np.array([0.35, 0.25, 0.9]) / np.linalg.norm([0.35, 0.25, 0.9])


def main(argv: list[str] | None = None) -> int:
    """Draw both pictures; 0."""
    parser = argparse.ArgumentParser(prog="room2dgs.tools.docs_pictures", description=__doc__)
    parser.add_argument("capture", help="what it was made from")
    parser.add_argument("run", type=Path, help="a finished run with a ground truth, z up")
    parser.add_argument("out", type=Path, help="the folder of the pictures")
    args = parser.parse_args(argv)
    config = load_config([f"scene.path={args.capture}", f"out={args.out}"])
    photos = [frame.color() for frame in read_scene(config.scene).frames]
    mesh = from_outside(trimesh.load_mesh(args.run / "mesh.ply", process=False))
    write(args.out / "hero.jpg", beside(contact_sheet(photos[::4], columns=3), mesh))
    write(args.out / "error.jpg", first_row(_picture(args.run / "eval/views.png")))
    held_out = sorted((args.run / "renders/test").glob("*.png"))
    write(args.out / "held_out.jpg", _picture(held_out[len(held_out) // 2]))
    return 0


def from_outside(mesh: trimesh.Trimesh) -> np.ndarray:
    """The mesh from above and outside, cut open towards the eye. (H, W, 3) uint8."""
    low, high = mesh.bounds
    middle = (low + high) / 2
    away = np.array([0.55, -1.0, 0.62])
    eye = middle + away * np.linalg.norm(high - low) * 1.22
    centre, up = middle - [-0.1, 0.0, 0.1], np.array([0.0, 0.0, -1.0])
    rays = o3d.t.geometry.RaycastingScene.create_rays_pinhole(
        34.0, o3c_tensor(centre), o3c_tensor(eye), o3c_tensor(up), WIDTH * OVERSAMPLED, HEIGHT * OVERSAMPLED
    )
    towards = np.einsum("ij,ij->i", mesh.face_normals, eye - mesh.triangles_center)
    front = away * [1.0, 1.0, 0.0] / np.linalg.norm(away[:2])
    far = (mesh.triangles_center - middle) @ front < CUT_M
    faces = mesh.faces[(towards > 0) & far]
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3c_tensor(mesh.vertices.astype(np.float32)), o3c_tensor(faces.astype(np.uint32)))
    visual: Any = mesh.visual
    hit = scene.cast_rays(rays)
    triangle = hit["primitive_ids"].numpy()
    seen = np.isfinite(hit["t_hit"].numpy())
    u, v = np.moveaxis(hit["primitive_uvs"].numpy(), -1, 0)
    weights = np.stack([1 - u - v, u, v], axis=-1)[seen]
    corners = faces[triangle[seen]]
    colors = np.einsum("ij,ijk->ik", weights, visual.vertex_colors[corners][..., :3].astype(float))
    normals = np.einsum("ij,ijk->ik", weights, mesh.vertex_normals[corners])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    shade = 0.78 + 0.32 * np.clip(normals @ LIGHT, 0.0, 1.0)
    picture = np.full((*seen.shape, 3), 255.0)
    picture[seen] = np.clip(colors * shade[:, None] * 1.08, 0, 255)
    return cv2.resize(picture.astype(np.uint8), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)


def contact_sheet(photos: list[np.ndarray], columns: int) -> np.ndarray:
    """Photos in rows, each 200 pixels wide, with white lines between them. (H, W, 3) uint8."""
    height = round(200 * photos[0].shape[0] / photos[0].shape[1])
    cells = [
        np.pad(
            cv2.resize(photo, (200, height), interpolation=cv2.INTER_AREA),
            ((4, 4), (4, 4), (0, 0)),
            constant_values=255,
        )
        for photo in photos
    ]
    rows = [np.hstack(cells[i : i + columns]) for i in range(0, len(cells) - columns + 1, columns)]
    return np.vstack(rows[: HEIGHT // (height + 8)])


def beside(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Both on white, with an arrow between. (H, W, 3) uint8."""
    left, right = (
        np.vstack([_white((HEIGHT - one.shape[0]) // 2, one), one, _white((HEIGHT - one.shape[0] + 1) // 2, one)])
        for one in (left, right)
    )
    gap = np.full((HEIGHT, 110, 3), 255, dtype=np.uint8)
    cv2.arrowedLine(gap, (15, HEIGHT // 2), (95, HEIGHT // 2), (0, 121, 107), 7, cv2.LINE_AA, tipLength=0.3)
    return np.hstack([left, gap, right])


def _white(rows: int, one: np.ndarray) -> np.ndarray:
    return np.full((rows, one.shape[1], 3), 255, dtype=np.uint8)


def first_row(sheet: np.ndarray) -> np.ndarray:
    """The first of the four rows of a sheet of errors, with the scale of colours at its end. (H, W, 3) uint8."""
    height, width = sheet.shape[:2]
    row = np.vstack([sheet[: round(0.2475 * height)], sheet[round(0.925 * height) :]])
    return cv2.resize(row, (1200, round(1200 * row.shape[0] / width)), interpolation=cv2.INTER_AREA)


def _picture(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR_RGB)
    assert picture is not None, path
    return np.asarray(picture)


def write(path: Path, picture: np.ndarray) -> None:
    """A JPEG of an RGB picture."""
    path.parent.mkdir(parents=True, exist_ok=True)
    _, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 86])
    with whole_file(path) as partial:
        Path(partial).write_bytes(data.tobytes())


if __name__ == "__main__":
    sys.exit(main())
