"""A run's splats as a page of its own: one file that any browser shows, without a network or a server."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from room2dgs.export.local_files import write_file
from room2dgs.export.source import Source
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.up_axis import up_axis
from room2dgs.primitives.primitive import Splats
from room2dgs.report.page import page, script
from room2dgs.runs.page import surfel_layer
from room2dgs.runs.page.cameras import first_side

SCRIPTS = ("three.min", "blocks", "discs", "room", "moves", "splats")
STRAY = 0.01  # of the splats, at either end of an axis: what flies about is not framed
MOST = 1_000_000  # splats, the largest and densest; a browser sorts them for each picture


def write_splats_page(source: Source, path: Path) -> list[Path]:
    """See `splats_page`; a note in the log where splats are left out."""
    scene, splats = source.scene, source.surfels
    if len(splats.centers) > MOST:
        source.log(f"html: the {MOST:,} largest of {len(splats.centers):,} splats")
    up = source.up
    text = splats_page(
        splats,
        [frame.camera for frame in scene.frames],
        up_axis([frame.camera for frame in scene.frames], np.zeros((0, 3))) if up is None else up,
        Path(source.config.scene.path).name,
        "m" if scene.metric else "units",
    )
    return write_file(path, text.encode("utf-8"))


def splats_page(splats: Splats, cameras: Sequence[Camera], up: np.ndarray, title: str, unit: str) -> str:
    """The page: discs of one colour each, that face the nearest camera; a person turns the room and walks in it.

    Args:
        cameras: in the splats' frame; walks begin at one of them.
        up: (3,) unit, in that frame.
        unit: of lengths.
    """
    discs, data = surfel_layer.block(splats, MOST, surfel_layer.to_nearest(cameras))
    centers = np.asarray(splats.centers.detach().numpy(), np.float64)
    low, high = np.quantile(centers, (STRAY, 1 - STRAY), axis=0) if len(centers) else (np.zeros(3), np.ones(3))
    beside = first_side(cameras, (low + high) / 2, up)
    about = {
        "up": up.tolist(),
        "beside": beside.tolist(),
        "below": beside.tolist(),
        "low": low.tolist(),
        "high": high.tolist(),
        "unit": unit,
        "discs": discs,
        "cameras": [
            {"at": camera.centre.tolist(), "turn": camera.world_from_cam[:3, :3].ravel().tolist()} for camera in cameras
        ],
    }
    return page("splats.html.j2", title=title, about=about, discs=data, scripts=[script(name) for name in SCRIPTS])
