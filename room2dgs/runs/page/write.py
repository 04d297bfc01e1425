"""A run's folder to its report.html."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from room2dgs.captures.image_files import read_photo
from room2dgs.captures.scene import Scene
from room2dgs.config import Config, dump_config
from room2dgs.errors import InputError
from room2dgs.eval.pictures import FULL_THRESHOLDS
from room2dgs.eval.shading import error_color
from room2dgs.files import whole_file
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.up_axis import up_axis
from room2dgs.logs import logged
from room2dgs.mesh.world import read_in_scene
from room2dgs.report.page import Figure, page
from room2dgs.runs.folder import EVAL, MESH, QUALITY, REPORT, TRUST
from room2dgs.runs.metrics import read_metrics
from room2dgs.runs.page import surfel_layer, texts, trust
from room2dgs.runs.page.coverage import Coverage, Spot, advice, coverage, spots
from room2dgs.runs.page.mesh_layer import SEEN, PageMesh, block, page_mesh, with_error, with_photos
from room2dgs.runs.page.plots import drawings, read_plots
from room2dgs.runs.page.views import FULL, KINDS, Rendered, view_pictures
from room2dgs.runs.trust import read_trust
from room2dgs.runs.verdict import noted_verdict

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats

BUTTONS = (
    ("color", "Colours"),
    ("shape", "Shape"),
    ("error", "Error"),
    ("seen", "Photos that see it"),
    ("discs", "Splats"),
)
KEY_STEPS = 5
WIDTH = 1200  # pixels of the picture of the boundary, at most


def write_report(scene: Scene, surfels: Splats | None, rendered: Rendered, config: Config, out: Path) -> Path:
    """Write out/report.html, whole or not at all.

    Args:
        scene: with the poses that the run worked with.
        surfels: None: the run trained nothing.
        rendered: renders frames of the scene.

    Returns:
        Its path.

    Raises:
        InputError: the run's mesh or a photo cannot be read.
    """
    metrics = read_metrics(out)
    log = logged(out)
    maps = read_trust(out / TRUST)
    source = str(metrics.get("depth_source") or "none")
    room, seen, places = _room(scene, config, out)
    settings = config.report
    text = page(
        "run.html.j2",
        title=f"Room from photos: {Path(config.scene.path).name}",
        opening=texts.opening(config, metrics),
        verdict=noted_verdict(metrics),
        facts=texts.facts(scene, metrics),
        warnings=texts.warnings(scene, config, metrics, log),
        solid=_page_mesh(room, surfels, places, scene, config, texts.threshold_m(metrics, config)) if room else None,
        views=view_pictures(scene, rendered, maps, settings.views),
        kinds=[kind for kind in KINDS if kind[0] != "trust" or maps],
        kind_keys=_kind_keys(source),
        whole=_whole(out, metrics),
        spots=[spot.text for spot in places],
        advice=advice(scene, seen),
        trusted=trust.sentences(maps, source),
        plots=drawings(read_plots(log)),
        tables=texts.tables(metrics),
        changed=texts.changed_settings(config),
        settings=dump_config(config),
        closing=texts.closing(metrics),
        scripts=[_script(name) for name in ("three.min.js", "viewer.js", "compare.js")],
    )
    with whole_file(out / REPORT) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return out / REPORT


def _room(scene: Scene, config: Config, out: Path) -> tuple[PageMesh | None, Coverage | None, list[Spot]]:
    if not (out / MESH).is_file():
        return None, None, []
    room = page_mesh(read_in_scene(out / MESH, scene.origin_m), config.report.faces)
    if not len(room.faces):
        return None, None, []
    room = with_error(room, out, scene.origin_m)
    seen = coverage(room, [frame.camera for frame in scene.train])
    return with_photos(room, seen.photos), seen, spots(room, seen, scene.frames)


def _whole(out: Path, metrics: dict[str, Any]) -> list[Figure]:
    """Pictures of where the mesh is torn; none if its figures are not these, or the picture is gone."""
    path = out / EVAL / QUALITY
    if not metrics.get("mesh_quality") or not path.is_file():
        return []
    try:
        pixels = read_photo(path, None)
    except InputError:  # damaged: the page does without
        return []
    shown = min(WIDTH, pixels.shape[1])
    size = shown, round(pixels.shape[0] * shown / pixels.shape[1])
    caption = (
        "Photo; mesh with its boundary (torn red, real edges blue, where no view looks grey, in free space violet)"
    )
    caption += "; pixels that the mesh does not cover (red, yellow where no depth is known)"
    return [Figure(caption, cv2.resize(pixels, size, interpolation=cv2.INTER_AREA) / 255)]


def _page_mesh(
    room: PageMesh, surfels: Splats | None, places: list[Spot], scene: Scene, config: Config, threshold_m: float
) -> dict[str, Any]:
    cameras = [frame.camera for frame in scene.frames]
    up = up_axis(cameras, room.normals)
    low, high = room.vertices.min(axis=0), room.vertices.max(axis=0)
    about_mesh, mesh_bytes = block(room)
    blocks = [("mesh", mesh_bytes)]
    about = {
        "up": up.tolist(),
        "beside": _beside(room, cameras, up).tolist(),
        "low": low.tolist(),
        "high": high.tolist(),
        "mesh": about_mesh,
        "spots": [{"at": spot.at.tolist()} for spot in places],
    }
    shown = dict.fromkeys(room.layers)
    caption = f"{len(room.faces):,} triangles of the mesh"
    if config.report.max_surfels and surfels is not None:
        about["discs"], surfel_bytes = surfel_layer.block(surfels, config.report.max_surfels, room)
        blocks.append(("discs", surfel_bytes))
        shown["discs"] = None
        caption += f" and {about['discs']['count']:,} of {len(surfels.centers):,} surfels"
    end_cm = FULL_THRESHOLDS * threshold_m * 100
    return {
        "buttons": [(name, label) for name, label in BUTTONS if name in shown],
        "about": about,
        "blocks": blocks,
        "legends": [
            (
                "error",
                _scale([f"{end_cm * step / (KEY_STEPS - 1):g} cm" for step in range(KEY_STEPS)], "off the truth"),
            ),
            ("seen", [(_css(color), label) for _, color, label in SEEN]),
        ],
        "caption": caption + ".",
    }


def _beside(room: PageMesh, cameras: Sequence[Camera], up: np.ndarray) -> np.ndarray:
    """(3,) unit, level: from where to look at first. Half a room is seen from the side of its cameras."""
    across = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    side = np.mean([camera.centre for camera in cameras], axis=0) - room.vertices.mean(axis=0)
    side = side - (side @ up) * up + 1e-3 * across
    return side / np.linalg.norm(side)


def _kind_keys(source: str) -> list[tuple[str, list[tuple[str, str]]]]:
    percent = [f"{FULL * step / (KEY_STEPS - 1):.0%}" for step in range(KEY_STEPS)]
    return [
        ("difference", _scale(percent, "of full brightness")),
        ("depth", [("", "Near red, far blue; black where nothing was reconstructed.")]),
        ("normals", [("", "Red: to the right, green: up, blue: towards the camera.")]),
        ("trust", trust.key(source)),
    ]


def _scale(labels: list[str], what: str) -> list[tuple[str, str]]:
    colors = error_color(np.linspace(0, 1, len(labels)), 1.0)
    return [
        *((_css(tuple(color)), label) for color, label in zip(colors, labels, strict=True)),
        ("", f"and more {what}"),
    ]


def _css(color: tuple[float, ...]) -> str:
    return f"rgb({', '.join(str(round(part * 255)) for part in color)})"


@cache
def _script(name: str) -> Any:
    """A script of ours or three.js, as it stands: nothing of the user's is in it."""
    from markupsafe import Markup

    return Markup(files("room2dgs.report").joinpath("web", name).read_text(encoding="utf-8"))
