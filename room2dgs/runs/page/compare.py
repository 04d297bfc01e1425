"""Two runs on one page: settings that differ, scores, and both rooms seen by one camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.config.keys import leaf_keys
from room2dgs.config.sentences import shown
from room2dgs.files import whole_file
from room2dgs.report.page import page, script
from room2dgs.report.table import NOTHING, Table, table
from room2dgs.runs.folder import value_at
from room2dgs.runs.page.mesh_layer import PageMesh
from room2dgs.runs.page.places import named_only
from room2dgs.runs.page.room import RoomFacts, completeness
from room2dgs.runs.page.solid import solid
from room2dgs.runs.page.texts import OWN, part
from room2dgs.runs.schema import is_number

SCRIPTS = ("three.min", "blocks", "discs", "room", "beside")
Value = Callable[[dict[str, Any]], Any]


@dataclass(frozen=True)
class Figure:
    """A figure of both runs.

    Attributes:
        of: from metrics.json; None where it was not measured.
        text: how it is written.
        better: 1: more is better, -1: less is, 0: neither.
    """

    label: str
    of: Value
    text: Callable[[float], str]
    better: int = 0


def _key(name: str, factor: float = 1.0) -> Value:
    return lambda metrics: metrics[name] * factor if is_number(metrics.get(name)) else None


FIGURES = (
    Figure("complete", completeness, lambda x: f"{x:.1%}", 1),
    Figure("F-score at 5 cm", _key("f_score_5cm"), lambda x: f"{x:.3f}", 1),
    Figure("precision at 5 cm", _key("precision_5cm"), lambda x: f"{x:.3f}", 1),
    Figure("recall at 5 cm", _key("recall_5cm"), lambda x: f"{x:.3f}", 1),
    Figure("accuracy", _key("accuracy_m", 1000), lambda x: f"{x:.1f} mm", -1),
    Figure("completion", _key("completion_m", 1000), lambda x: f"{x:.1f} mm", -1),
    Figure("PSNR of held-out photos", _key("psnr_db"), lambda x: f"{x:.2f} dB", 1),
    Figure("SSIM of held-out photos", _key("ssim"), lambda x: f"{x:.3f}", 1),
    Figure("tears", lambda m: part(m, "mesh_quality").get("tears_per_m"), lambda x: f"{x:.2f} m per m²", -1),
    Figure("triangles", _key("mesh_faces"), lambda x: f"{x:,.0f}"),
    Figure("surfels", _key("primitives"), lambda x: f"{x:,.0f}"),
    Figure("seconds in all", lambda m: sum(part(m, "seconds").values()) or None, lambda x: f"{x:.0f} s", -1),
    Figure("seconds of all cores", lambda m: sum(part(m, "cpu_seconds").values()) or None, lambda x: f"{x:.0f} s", -1),
    Figure("peak memory", _key("peak_memory_mb", 0.001), lambda x: f"{x:.2f} GB", -1),
)


@dataclass(frozen=True)
class Side:
    """One of the two runs.

    Attributes:
        name: of its folder.
        mesh: with few triangles.
    """

    name: str
    config: Config
    metrics: dict[str, Any]
    scene: Scene
    mesh: PageMesh
    facts: RoomFacts


def write_comparison(first: Side, second: Side, path: Path) -> None:
    """The page, whole or not at all; it opens without a network."""
    names = first.name, second.name
    if names[0] == names[1]:
        names = f"{names[0]} (1)", f"{names[1]} (2)"
    rooms = []
    for letter, name, side in zip("ab", names, (first, second), strict=True):
        drawn = solid(side.mesh, None, [], side.scene, side.config, side.facts, photos=False)
        rooms.append({"letter": letter, "name": name, "verdict": _word(side), **drawn})
    same = first.config.scene.path == second.config.scene.path
    if same:  # one room: both are framed as the first is
        for fact in ("up", "beside", "below", "low", "high"):
            rooms[1]["about"][fact] = rooms[0]["about"][fact]
    text = page(
        "compare.html.j2",
        title=f"{names[0]} and {names[1]}",
        rooms=rooms,
        buttons=[one for one in rooms[0]["buttons"] if one in rooms[1]["buttons"]],
        scores=score_table(names, first.metrics, second.metrics),
        settings=settings_table(names, first.config, second.config),
        note="" if same else "The runs are of two captures; the camera turns about the middle of each room.",
        scripts=[script(name) for name in SCRIPTS],
    )
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def score_table(names: tuple[str, str], first: dict[str, Any], second: dict[str, Any]) -> Table:
    """Figures that one of the runs has at least, and by how much the second's are better or worse."""
    rows = []
    for figure in FIGURES:
        values = figure.of(first), figure.of(second)
        if values == (None, None):
            continue
        texts = tuple(NOTHING if value is None else figure.text(value) for value in values)
        rows.append((figure.label, *texts, _difference(figure, *values)))
    columns: dict[str, Callable[[Any], str]] = {
        "figure": lambda row: row[0],
        names[0]: lambda row: row[1],
        names[1]: lambda row: row[2],
        "the second is": lambda row: row[3],
    }
    return table("Scores", columns, rows)


def settings_table(names: tuple[str, str], first: Config, second: Config) -> Table:
    """Settings that differ."""
    one, other = named_only(first), named_only(second)
    differ = [
        key for key in leaf_keys() if key.name not in OWN and value_at(one, key.name) != value_at(other, key.name)
    ]
    columns = {
        "setting": lambda key: key.name,
        names[0]: lambda key: shown(value_at(one, key.name)),
        names[1]: lambda key: shown(value_at(other, key.name)),
        "what it is": lambda key: key.comment,
    }
    return table("", columns, differ)


def _difference(figure: Figure, first: float | None, second: float | None) -> str:
    if first is None or second is None:
        return NOTHING
    if figure.text(first) == figure.text(second):
        return "the same"
    if not figure.better:
        return NOTHING
    return "better" if (second - first) * figure.better > 0 else "worse"


def _word(side: Side) -> str:
    return str(part(side.metrics, "verdict").get("word") or "")
