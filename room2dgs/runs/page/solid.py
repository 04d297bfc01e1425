"""The room of a page: the blocks and facts that room.js reads."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.geometry.up_axis import up_axis
from room2dgs.runs.page import surfel_layer
from room2dgs.runs.page.cameras import camera_list, camera_size_m, first_side, path_of
from room2dgs.runs.page.coverage import Spot
from room2dgs.runs.page.mesh_layer import PageMesh, block
from room2dgs.runs.page.room import RoomFacts, belongs

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats

BUTTONS = (
    ("color", "Colours"),
    ("shape", "Shape"),
    ("expected", "Expected error"),
    ("error", "Error"),
    ("seen", "Photos that see it"),
    ("discs", "Splats"),
)
STRAY = 0.002  # of the vertices, at either end of an axis: what flies about is not framed
PHOTOS_A_VIEW = 8  # in the room, for each of report.views


def solid(
    room: PageMesh,
    surfels: Splats | None,
    places: Sequence[Spot],
    scene: Scene,
    config: Config,
    facts: RoomFacts,
    photos: bool = True,
) -> dict[str, Any]:
    """For the template: blocks of bytes, buttons of what they show, and what room.js and photos.js want to know.

    Args:
        photos: whether cameras have their photos.
    """
    cameras = [frame.camera for frame in scene.frames]
    up = up_axis(cameras, room.normals)
    low, high = np.quantile(room.vertices, (STRAY, 1 - STRAY), axis=0)
    about_mesh, mesh_bytes = block(room)
    blocks = [("mesh", mesh_bytes)]
    most = PHOTOS_A_VIEW * config.report.views if photos else 0
    pictured = camera_list(scene.frames, {spot.photo for spot in places if spot.photo}, most)
    numbers = {one["name"]: number for number, one in enumerate(pictured)}
    beside = first_side(cameras, room.vertices.mean(axis=0), up)
    about: dict[str, Any] = {
        "up": up.tolist(),
        "beside": beside.tolist(),
        "below": (beside if facts.level_from_world is None else -facts.level_from_world[1]).tolist(),
        "low": low.tolist(),
        "high": high.tolist(),
        "unit": "m" if scene.metric else "units",
        "mesh": about_mesh,
        "spots": [
            {"at": spot.at.tolist(), "camera": numbers.get(spot.photo) if spot.photo else None} for spot in places
        ],
        "cameras": pictured,
        "camera_m": camera_size_m(cameras),
        "path": path_of(scene.frames),
    }
    shown = dict.fromkeys(room.layers)
    if facts.glb and facts.scene_from_glb is not None and belongs(facts.glb, facts.scene_from_glb, room.vertices):
        about["glb"] = {"scene_from_file": facts.scene_from_glb.ravel().tolist()}
        blocks.append(("glb", base64.b64encode(facts.glb).decode("ascii")))
    caption = f"{len(room.faces):,} triangles of the mesh"
    if config.report.max_surfels and surfels is not None:
        about["discs"], surfel_bytes = surfel_layer.block(
            surfels, config.report.max_surfels, surfel_layer.as_mesh_faces(room)
        )
        blocks.append(("discs", surfel_bytes))
        shown["discs"] = None
        caption += f" and {about['discs']['count']:,} of {len(surfels.centers):,} surfels"
    return {
        "buttons": [(name, label) for name, label in BUTTONS if name in shown],
        "about": about,
        "blocks": blocks,
        "caption": caption + ".",
        "textured": "glb" in about,
        "spots": [about_spot["camera"] for about_spot in about["spots"]],
    }


def box_m(room: PageMesh) -> np.ndarray:
    """(3,) sides of the box around the mesh, the longest first."""
    low, high = np.quantile(room.vertices, (STRAY, 1 - STRAY), axis=0)
    return np.sort(high - low)[::-1]
