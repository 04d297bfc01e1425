"""The formats of `room2dgs export`, in the order in which help and documentation show them.

An exporter is a function (source, path) that writes a run (`export.source.Source`) to the path, a file or a folder,
and returns the files. A new one is a module with such a function and an entry here. Another package brings one by an
entry point of the group "room2dgs.exporters", whose name is the format's and that of its file or folder:

    [project.entry-points."room2dgs.exporters"]
    myformat = "mypackage.myformat:write_mine"

Facts:
    place: the file or folder that it becomes, in the folder of exports; without it the format's name.
    needs: what the run must have come to (surfels, mesh), and optional libraries; without it nothing.
    after_run: it takes about a second, so that every run may write it at its end (`export.after_run`).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from room2dgs.registry import Entry, Registry

if TYPE_CHECKING:
    from room2dgs.export.source import Source

Write: TypeAlias = "Callable[[Source, Path], list[Path]]"

EXPORTERS: Registry[Write] = Registry("format", "room2dgs.exporters")
_AT = "room2dgs.export"
_SPLATS, _MESH = {"needs": ("surfels",)}, {"needs": ("mesh",)}
EXPORTERS.register(
    "splats",
    f"{_AT}.gaussian_ply:write_splats",
    "Gaussians for every 3DGS viewer.",
    place="splats.ply",
    after_run=True,
    **_SPLATS,
)
EXPORTERS.register(
    "splats_2dgs",
    f"{_AT}.gaussian_ply:write_splats_2dgs",
    "Discs, for 2DGS tools alone.",
    place="splats_2dgs.ply",
    after_run=True,
    **_SPLATS,
)
EXPORTERS.register(
    "splat",
    f"{_AT}.splat_file:write_splat",
    "Gaussians of one colour each, for web viewers.",
    place="splats.splat",
    after_run=True,
    **_SPLATS,
)
EXPORTERS.register(
    "spz",
    f"{_AT}.spz:write_spz",
    "Gaussians, compressed: Scaniverse, Spark, SuperSplat.",
    place="splats.spz",
    after_run=True,
    **_SPLATS,
)
EXPORTERS.register(
    "glb",
    f"{_AT}.mesh_files:write_glb",
    "glTF: browsers, Windows, Blender, engines.",
    place="mesh.glb",
    after_run=True,
    **_MESH,
)
EXPORTERS.register("obj", f"{_AT}.mesh_files:write_obj", "A mesh for every program.", place="mesh.obj", **_MESH)
EXPORTERS.register(
    "ply",
    f"{_AT}.mesh_files:write_ply",
    "MeshLab, CloudCompare, Blender; in the capture's own world.",
    place="mesh.ply",
    **_MESH,
)
EXPORTERS.register(
    "stl", f"{_AT}.stl:write_stl", "Triangles alone, metres, z up: CAD, printers.", place="mesh.stl", **_MESH
)
EXPORTERS.register(
    "textured",
    f"{_AT}.texture.write:write_textured_glb",
    "Few faces and a picture, for the web.",
    place="textured.glb",
    **_MESH,
)
EXPORTERS.register("textured_obj", f"{_AT}.texture.write:write_textured_obj", "The same as OBJ, MTL, PNG.", **_MESH)
EXPORTERS.register(
    "usdz",
    f"{_AT}.texture.usdz:write_usdz",
    "Few faces and a picture, for iPhones and USD.",
    place="room.usdz",
    **_MESH,
)
EXPORTERS.register(
    "html",
    f"{_AT}.splats_page:write_splats_page",
    "Splats as a page that opens anywhere, without a network.",
    place="splats.html",
    **_SPLATS,
)
EXPORTERS.register(
    "points",
    f"{_AT}.point_cloud:write_points",
    "A point a surfel, with normals: CloudCompare.",
    place="points.ply",
    **_SPLATS,
)
EXPORTERS.register("depth", f"{_AT}.depth_maps:write_depth", "16-bit PNG, millimetres, one a view.", **_SPLATS)
EXPORTERS.register("depth_npy", f"{_AT}.depth_maps:write_depth_npy", "float32, metres, one a view.", **_SPLATS)
EXPORTERS.register("normals", f"{_AT}.depth_maps:write_normals", "16-bit PNG, world frame, one a view.", **_SPLATS)
EXPORTERS.register("normals_npy", f"{_AT}.depth_maps:write_normals_npy", "float32, world frame, one a view.", **_SPLATS)
EXPORTERS.register("colmap", f"{_AT}.colmap_model:write_colmap", "The prepared capture for splat trainers.")
EXPORTERS.register("colmap_text", f"{_AT}.colmap_model:write_colmap_text", "The same, readable.")
EXPORTERS.register("transforms", f"{_AT}.transforms_json:write_transforms", "The same for nerfstudio.")
EXPORTERS.register(
    "inria", f"{_AT}.inria_folder:write_inria", "The folder of the first splatting code, for SIBR.", **_SPLATS
)


def place_of(entry: Entry[Write]) -> str:
    """The file or folder that a format becomes, in the folder of exports."""
    return entry.facts.get("place", entry.name)


def needs_of(entry: Entry[Write]) -> tuple[str, ...]:
    """What a format needs of the run, and of libraries."""
    return entry.facts.get("needs", ())
