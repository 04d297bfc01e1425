"""A run's folder to its report.html."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2

from room2dgs.captures.image_files import read_photo
from room2dgs.captures.scene import Scene
from room2dgs.config import Config, dump_config
from room2dgs.errors import InputError
from room2dgs.eval.boundary_kinds import WORDS as KINDS_BEYOND
from room2dgs.eval.pictures import FULL_THRESHOLDS
from room2dgs.files import whole_file
from room2dgs.logs import logged
from room2dgs.mesh.boundary_file import BoundaryEdges, read_boundary
from room2dgs.mesh.world import read_in_scene
from room2dgs.report.page import Figure, page, script
from room2dgs.report.table import Table
from room2dgs.runs.folder import BOUNDARY, EVAL, MESH, MIRRORS, QUALITY, REPORT, TEXTURED
from room2dgs.runs.metrics import read_metrics
from room2dgs.runs.mirrors import read_mirrors, trusted_depths
from room2dgs.runs.page import texts, trust
from room2dgs.runs.page.boundary import boundary_figure, boundary_sentences
from room2dgs.runs.page.coverage import Coverage, Spot, advice, coverage, spots
from room2dgs.runs.page.keys import kind_keys, layer_keys
from room2dgs.runs.page.mesh_layer import PageMesh, page_mesh, with_error, with_expected, with_off, with_photos
from room2dgs.runs.page.mirrors import mirror_figures
from room2dgs.runs.page.places import Places, named_only
from room2dgs.runs.page.plots import drawings, read_plots
from room2dgs.runs.page.results import files_of, next_steps
from room2dgs.runs.page.room import RoomFacts, first_facts
from room2dgs.runs.page.solid import box_m, solid
from room2dgs.runs.page.views import KINDS, Rendered, view_pictures
from room2dgs.runs.trust import Trust
from room2dgs.runs.verdict import noted_verdict

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats

SCRIPTS = ("three.min", "blocks", "discs", "room", "moves", "tape", "photos", "page", "wipe")
WIDTH = 1200  # pixels of the picture of the boundary, at most


def write_report(
    scene: Scene,
    surfels: Splats | None,
    rendered: Rendered,
    config: Config,
    out: Path,
    facts: RoomFacts | None = None,
    dimensions: Table | None = None,
) -> Path:
    """Write out/report.html, whole or not at all.

    Args:
        scene: with the poses that the run worked with.
        surfels: None: the run trained nothing.
        rendered: renders frames of the scene.
        facts: how large the room is, its plan, and its mesh with the photos on it; None: nothing is known.
        dimensions: of the rooms; None: there are none.

    Returns:
        Its path.

    Raises:
        InputError: the run's mesh or a photo cannot be read.
    """
    metrics = read_metrics(out)
    log = logged(out)
    maps = trusted_depths(out, scene)
    source = str(metrics.get("depth_source") or "none")
    facts, places = facts or RoomFacts(), Places(config)
    room, seen, wanting = _room(scene, config, out, maps)
    drawn = solid(room, surfels, wanting, scene, config, facts) if room else None
    inside = drawn is not None and drawn["textured"]
    unit = "m" if scene.metric else "units"
    text = page(
        "run.html.j2",
        title=Path(config.scene.path).name,
        opening=places.out_of(texts.opening(config, metrics)),
        verdict=places.out_of_verdict(noted_verdict(metrics)),
        first=first_facts(facts, metrics, unit, box_m(room) if room else None),
        facts=texts.facts(scene, metrics),
        warnings=places.out_of_all(texts.warnings(scene, config, metrics, log)),
        solid=drawn,
        layer_keys=layer_keys(texts.threshold_m(metrics, config), FULL_THRESHOLDS),
        plan=facts.plan,
        dimensions=dimensions,
        files=files_of(out, inside),
        steps=next_steps(out.absolute().name, (out / TEXTURED).is_file(), surfels is not None),
        views=view_pictures(scene, rendered, maps, config.report.views),
        kinds=[kind for kind in KINDS if kind[0] != "trust" or maps],
        kind_keys=kind_keys(source),
        whole=[*_mirrors(scene, out, unit), *_boundary(scene, out), *_whole(out, metrics)],
        spots=[spot.text for spot in wanting],
        advice=places.out_of_all([*boundary_sentences(metrics, unit), *advice(scene, seen)]),
        trusted=trust.sentences(maps, source),
        plots=drawings(read_plots(log)),
        tables=texts.tables(metrics),
        changed=texts.changed_settings(named_only(config)),
        settings=dump_config(named_only(config)),
        closing=texts.closing(metrics),
        scripts=[script(name) for name in SCRIPTS],
    )
    with whole_file(out / REPORT) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return out / REPORT


def _room(
    scene: Scene, config: Config, out: Path, maps: dict[str, Trust]
) -> tuple[PageMesh | None, Coverage | None, list[Spot]]:
    room = run_mesh(scene, config, out)
    if room is None:
        return None, None, []
    seen = coverage(room, scene.train, maps)
    room = with_photos(room, seen.photos)
    if room.off_m is None:
        room = with_off(room, seen.off_m)
    return room, seen, spots(room, seen, scene.frames, run_boundary(scene, out))


def run_mesh(scene: Scene, config: Config, out: Path) -> PageMesh | None:
    """The run's mesh with few triangles, and its error where it was scored; None: there is none.

    Raises:
        InputError: it cannot be read.
    """
    if not (out / MESH).is_file():
        return None
    mesh = read_in_scene(out / MESH, scene.origin_m)
    room = page_mesh(mesh, config.report.faces)
    if not len(room.faces):
        return None
    full_m = FULL_THRESHOLDS * texts.threshold_m(read_metrics(out), config)
    return with_error(with_expected(room, mesh, full_m), out, scene.origin_m)


def run_boundary(scene: Scene, out: Path) -> BoundaryEdges | None:
    """What the run says of its mesh's boundary, scene's frame; None: nothing.

    Raises:
        InputError: it cannot be read.
    """
    if not (out / BOUNDARY).is_file():
        return None
    return read_boundary(out / BOUNDARY, len(KINDS_BEYOND), scene.origin_m)


def _mirrors(scene: Scene, out: Path, unit: str) -> list[Figure]:
    return mirror_figures(read_mirrors(out / MIRRORS, scene.origin_m), scene.frames, unit)


def _boundary(scene: Scene, out: Path) -> list[Figure]:
    edges = run_boundary(scene, out)
    if edges is None or not len(edges.kind) or not (out / MESH).is_file():
        return []
    figure = boundary_figure(read_in_scene(out / MESH, scene.origin_m), edges, scene.frames)
    return [] if figure is None else [figure]


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
