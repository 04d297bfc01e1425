"""The files of a run, what opens them, and what a person can do next."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from room2dgs.runs.folder import EXPORTS, MESH, TEXTURED
from room2dgs.texts import shown

OPENERS = (
    (TEXTURED, "The room with its photos on it", "browsers, phones, Windows 3D Viewer, Blender, Godot"),
    (MESH, "The fine mesh, in metres", "MeshLab, CloudCompare, Blender"),
    (f"{EXPORTS}/splats.ply", "The splats", "SuperSplat, Spark and other splat viewers"),
    (f"{EXPORTS}/splats.spz", "The splats, packed", "Spark, Niantic Studio"),
    ("plan/plan.svg", "The floor plan", "browsers, Inkscape"),
    ("plan/plan.dxf", "The floor plan for CAD", "AutoCAD, LibreCAD, QCAD"),
    (f"{EXPORTS}/points.ply", "The points", "MeshLab, CloudCompare"),
    ("dense.ply", "The points", "MeshLab, CloudCompare"),
    ("metrics.json", "All figures", "any program, any editor"),
)


class File(NamedTuple):
    """A file of the run.

    Attributes:
        path: in the run's folder.
        inside: name of the page's block that holds it; "" if it lies beside the page alone.
    """

    path: str
    what: str
    opens: str
    size: str
    inside: str = ""


class Step(NamedTuple):
    """A command and what it is good for."""

    what: str
    command: str


def files_of(out: Path, glb_inside: bool) -> list[File]:
    """Those that are there.

    Args:
        glb_inside: whether the page holds the textured mesh.
    """
    return [
        File(name, what, opens, _size((out / name).stat().st_size), "glb" if glb_inside and name == TEXTURED else "")
        for name, what, opens in OPENERS
        if (out / name).is_file()
    ]


def next_steps(run: str, textured: bool, trained: bool) -> list[Step]:
    """Commands, for who stands in the folder that holds the run.

    Args:
        run: name of its folder.
        textured: whether it has a mesh with a picture already.
        trained: whether it has surfels.
    """
    import shlex

    name = shlex.quote(shown(run))
    steps = [
        Step("Walk through it", f"room2dgs view {name}"),
        Step("Draw the floor plan", f"room2dgs plan {name}"),
    ]
    if not textured:
        steps.append(Step("Put the photos on it", f"room2dgs export {name} to=textured"))
    steps.append(Step("Give it to other programs", f"room2dgs export {name} to=all"))
    if trained:
        steps.append(Step("Film a flight through it", f"room2dgs render {name} path=smooth"))
    return steps


def _size(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{max(1, round(count / 1e3))} kB"
