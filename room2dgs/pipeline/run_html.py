"""What a notebook shows of a run: a picture, its scores and its files."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from room2dgs.captures.image_files import read_photo
from room2dgs.errors import InputError
from room2dgs.report.page import data_uri
from room2dgs.runs.folder import MESH, RENDERS

if TYPE_CHECKING:
    from room2dgs.pipeline.run import Run

WIDTH = 960  # pixels of the picture, at most
SHOWN = {"f_score_": "F-score", "precision_": "precision", "recall_": "recall", "psnr_db": "PSNR", "ssim": "SSIM"}


def run_html(run: Run) -> str:
    """A picture inside the page, the scores, and the files that are there; nothing is loaded from a network."""
    parts = [f"<p><b>{escape(str(run.path))}</b></p>"]
    picture = run_picture(run)
    if picture is not None:
        parts.append(f'<img src="{data_uri(picture)}" alt="what came out" style="max-width: 100%">')
    try:
        figures = run.scores
    except InputError as error:
        return "".join([*parts, f"<p>{escape(str(error))}</p>"])
    rows = [
        f"<tr><td>{escape(label + ' ' + name.removeprefix(start).replace('_', ' '))}</td><td>{value:.3f}</td></tr>"
        for start, label in SHOWN.items()
        for name, value in figures.items()
        if name.startswith(start)
    ]
    files = ", ".join(sorted(path.name for path in run.paths.values()))
    return "".join([*parts, f"<table>{''.join(rows)}</table>", f"<p>{escape(files)}</p>"])


def run_picture(run: Run) -> np.ndarray | None:
    """(H, W, 3) RGB 0..1: a held-out photo beside its rendering; else the mesh beside its errors; else the mesh.

    None: there is nothing to see yet.
    """
    for path in (*sorted((run.path / RENDERS / "test").glob("*.png")), run.path / "eval" / "views.png"):
        pixels = _read(path)
        if pixels is not None:
            return pixels
    return _of_mesh(run) if (run.path / MESH).is_file() else None


def _read(path: Path) -> np.ndarray | None:
    try:
        pixels = read_photo(path, None)
    except InputError:  # missing or damaged
        return None
    height, width = pixels.shape[:2]
    if width > WIDTH:
        pixels = cv2.resize(pixels, (WIDTH, round(height * WIDTH / width)), interpolation=cv2.INTER_AREA)
    return pixels / 255.0


def _of_mesh(run: Run) -> np.ndarray | None:
    """What the middle camera sees of the mesh; None where the capture is gone."""
    from room2dgs.runs.page.mesh_views import DrawnMesh

    try:
        cameras, mesh = list(run.cameras.values()), run.mesh
    except InputError:
        return None
    camera = cameras[len(cameras) // 2]
    camera = camera.resized_to_width(min(WIDTH // 2, camera.width))
    return DrawnMesh(mesh).rendering(camera, (1.0, 1.0, 1.0)).color.numpy()
