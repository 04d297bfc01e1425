"""The page of `room2dgs depth`: what share of the photos has depth, how sure it is, and how long it took."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.captures.uncertainty import stereo_weight
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import Config, dump_config
from room2dgs.files import whole_file
from room2dgs.logs import logged
from room2dgs.report.page import Figure, page
from room2dgs.report.table import NOTHING, Table, table
from room2dgs.runs.depth_coverage import Coverage, counted, total
from room2dgs.runs.folder import REPORT
from room2dgs.runs.metrics import read_metrics
from room2dgs.runs.page import texts, trust
from room2dgs.runs.page.views import small
from room2dgs.runs.pictures import depth_picture
from room2dgs.runs.trust import Trust

if TYPE_CHECKING:
    from room2dgs.stereo.dense import DenseView

COUNTS = ((2, 2), (3, 4), (5, 6), (7, None))  # consistent photos, as the tables have them
LITTLE = 0.1  # of the pixels; photos with less are named
TILE = 320  # pixels of a picture's width, at most
ADVICE = (
    "Blank walls, gloss and blur stay empty; so does what only one photo sees, and what was filmed while turning on "
    "the spot. More light, a slower walk and steps to the side help."
)


def write_depth_report(
    scene: Scene,
    views: Sequence[DenseView],
    filled: Mapping[str, ViewMaps[np.ndarray]],
    photos: Sequence[Coverage],
    config: Config,
    out: Path,
) -> Path:
    """Write out/report.html from what is in the folder's metrics.json too, whole or not at all.

    Args:
        views: stereo's, in the order of the training views.
        filled: frame name -> filled depth; empty: nothing was filled.
        photos: coverage, in the same order.

    Returns:
        Its path.

    Raises:
        InputError: a photo cannot be read.
    """
    whole, metrics = total(photos), read_metrics(out)
    pictured = _pictured(scene.keyframes, views, filled, config.report.views)
    text = page(
        "depth.html.j2",
        title=f"Depth from photos: {Path(config.scene.path).name}",
        opening=f"Capture {config.scene.path}: every photo was compared with its neighbours, in {config.out}.",
        facts=_facts(whole, len(photos), metrics),
        warnings=[*_warnings(scene, out), *_little(photos)],
        advice=ADVICE,
        tables=[_totals(whole), _seconds(metrics, len(photos))],
        pictured=pictured,
        keys=_keys(str(metrics.get("depth_source") or "none"), bool(filled)),
        photos=_table("", photos),
        changed=texts.changed_settings(config),
        settings=dump_config(config),
        closing=texts.closing(metrics),
    )
    with whole_file(out / REPORT) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return out / REPORT


def _facts(whole: Coverage, count: int, metrics: dict[str, Any]) -> list[dict[str, str]]:
    wall, cpu = (sum(texts.part(metrics, key).values()) for key in ("seconds", "cpu_seconds"))
    found = [(str(count), "photos"), (_share(whole.stereo), "of the pixels have stereo's depth")]
    if whole.filled is not None:
        found.append((_share(whole.filled), "were filled"))
    if whole.error_m is not None:
        found.append((f"{1000 * whole.error_m:.1f} mm", "expected error of stereo (median)"))
    found.append((f"{wall / count:.2f} s", f"a photo ({cpu / count:.2f} s of all cores)"))
    return [{"value": value, "what": what} for value, what in found]


def _warnings(scene: Scene, out: Path) -> list[str]:
    """The capture's, and what the log warned of besides."""
    return list(dict.fromkeys([*scene.warnings, *texts.logged_warnings(logged(out))]))


def _little(photos: Sequence[Coverage]) -> list[str]:
    names = [one.photo for one in photos if one.stereo < LITTLE]
    if not names:
        return []
    some = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
    return [f"Stereo kept less than {LITTLE:.0%} of the pixels of {len(names)} of {len(photos)} photos: {some}."]


def _totals(whole: Coverage) -> Table:
    rows = [(f"{_number(*counts)} photos agree", counted(whole.num_consistent, *counts)) for counts in COUNTS]
    rows.append(("stereo's depth in all", whole.stereo))
    empty = 1 - whole.stereo
    if whole.filled is not None and whole.filled_sure is not None:
        rows.append(("filled, confidence 0.5 or more", whole.filled_sure))
        rows.append(("filled, less sure", whole.filled - whole.filled_sure))
        empty -= whole.filled
    rows.append(("no depth", max(empty, 0.0)))
    columns = {"pixels": lambda row: row[0], "share": lambda row: _share(row[1])}
    return table("What the photos' pixels have", columns, rows)


def _seconds(metrics: dict[str, Any], count: int) -> Table:
    wall, cpu, memory = (texts.part(metrics, key) for key in ("seconds", "cpu_seconds", "stage_peak_memory_mb"))
    columns = {
        "stage": lambda stage: stage,
        "seconds": lambda stage: f"{wall[stage]:.1f}",
        "seconds of all cores": lambda stage: f"{cpu[stage]:.1f}" if stage in cpu else NOTHING,
        "a photo": lambda stage: f"{wall[stage] / count:.2f}",
        "a photo, all cores": lambda stage: f"{cpu[stage] / count:.2f}" if stage in cpu else NOTHING,
        "peak memory up to its end": lambda stage: f"{memory[stage] / 1000:.2f} GB" if stage in memory else NOTHING,
    }
    return table("Seconds by stage", columns, wall)


def _table(title: str, photos: Iterable[Coverage]) -> Table:
    """A row for each photo."""
    photos = list(photos)
    columns = {"photo": lambda one: one.photo, "stereo": lambda one: _share(one.stereo)}
    for counts in COUNTS:
        columns[f"{_number(*counts)} agree"] = partial(_consistent_share, counts)
    columns["expected error"] = lambda one: NOTHING if one.error_m is None else f"{1000 * one.error_m:.1f} mm"
    if any(one.filled is not None for one in photos):
        columns["filled"] = lambda one: NOTHING if one.filled is None else _share(one.filled)
        columns["of it sure"] = lambda one: NOTHING if one.filled_sure is None else _share(one.filled_sure)
    return table(title, columns, photos)


def _consistent_share(counts: tuple[int, int | None], one: Coverage) -> str:
    """Of the pixels that from counts[0] to counts[1] other photos are consistent with; None: or more."""
    return _share(counted(one.num_consistent, *counts))


def _pictured(
    frames: Sequence[Frame], views: Sequence[DenseView], filled: Mapping[str, ViewMaps[np.ndarray]], most: int
) -> list[tuple[str, list[Figure]]]:
    """Name and pictures of some photos."""
    by_name = {frame.name: view for frame, view in zip(frames, views, strict=True)}
    return [
        (frame.name, _figures(frame, by_name[frame.name], filled.get(frame.name)))
        for frame in evenly_spaced(frames, most)
    ]


def _figures(frame: Frame, view: DenseView, maps: ViewMaps[np.ndarray] | None) -> list[Figure]:
    stereo = Trust(_bytes(stereo_weight(view.num_consistent)), np.full(view.depth.shape, trust.SURE, np.uint8))
    pictures = [
        ("photo", frame.color()),
        ("stereo's depth", depth_picture(view.depth, view.depth > 0)),
        ("its confidence", trust.picture(stereo)),
    ]
    if maps is not None and maps.depth is not None:
        num_consistent = cv2.resize(view.num_consistent, maps.depth.shape[::-1], interpolation=cv2.INTER_NEAREST_EXACT)
        sure = (maps.depth > 0).astype(np.float32) if maps.depth_confidence is None else maps.depth_confidence
        pictures.append(("filled depth", depth_picture(maps.depth, maps.depth > 0)))
        pictures.append(("its confidence", trust.picture(Trust(_bytes(sure), num_consistent))))
    return [Figure(caption, small(picture / 255, TILE)) for caption, picture in pictures]


def _keys(source: str, filled: bool) -> list[list[tuple[str, str]]]:
    stereo = [*trust.stereo_key(), ("", "Depth: near red, far blue, black where there is none.")]
    return [stereo, trust.key(source)] if filled else [stereo]


def _bytes(share: np.ndarray) -> np.ndarray:
    return np.round(np.clip(share, 0, 1) * 255).astype(np.uint8)


def _number(least: int, most: int | None) -> str:
    if most is None:
        return f"{least} or more"
    return str(least) if least == most else f"{least} or {most}"


def _share(value: float) -> str:
    return f"{value:.1%}"
