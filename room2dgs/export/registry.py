"""The formats by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from room2dgs.files import whole_file

if TYPE_CHECKING:  # the formats' names are asked for by the help and by completion, which should not wait for torch
    from room2dgs.export.source import Source


class Format(NamedTuple):
    """One format.

    Attributes:
        name: as the user asks for it.
        place: the file or folder that it becomes, in the folder of exports.
        words: what opens it, in a line.
        write: writes it to the path; returns the files, whole ones alone.
        needs: what the run must have come to (surfels, mesh), and optional libraries.
    """

    name: str
    place: str
    words: str
    write: Callable[[Source, Path], list[Path]]
    needs: tuple[str, ...]


def _file(data: Callable[[Source], bytes]) -> Callable[[Source, Path], list[Path]]:
    """Writes one file."""

    def write(source: Source, path: Path) -> list[Path]:
        contents = data(source)
        with whole_file(path) as temporary:
            temporary.write_bytes(contents)
        return [path]

    return write


def _local(data: Callable[[Source], bytes], axes: str) -> Callable[[Source, Path], list[Path]]:
    """Writes one file of coordinates in float32 or less, and what they count from beside it.

    Args:
        axes: property of `Source` that turns the world to the file's frame.
    """

    def write(source: Source, path: Path) -> list[Path]:
        from room2dgs.export.local_files import write_offset

        return [*_file(data)(source, path), *write_offset(source, path, getattr(source, axes))]

    return write


def _splats(source: Source) -> bytes:
    from room2dgs.export.gaussian_ply import gaussian_ply

    return gaussian_ply(source.surfels_y_down, comments=source.comments(source.y_down))


def _splats_2dgs(source: Source) -> bytes:
    from room2dgs.export.gaussian_ply import gaussian_ply

    comments = ["SplatRenderMode: 2dgs", *source.comments(source.y_down)]
    return gaussian_ply(source.surfels_y_down, third_scale=False, comments=comments)


def _splat(source: Source) -> bytes:
    from room2dgs.export.splat_file import splat_bytes

    return splat_bytes(source.surfels_y_down)


def _spz(source: Source) -> bytes:
    from room2dgs.export.axes import turned
    from room2dgs.export.spz import spz_bytes

    return spz_bytes(turned(source.surfels, source.y_up))


def _glb(source: Source) -> bytes:
    from room2dgs.export.mesh_files import glb

    return glb(source.hand_over, source.y_up, source.offset_m(source.y_up))


def _obj(source: Source) -> bytes:
    from room2dgs.export.mesh_files import obj

    return obj(source.hand_over, source.y_up, source.offset_m(source.y_up))


def _ply(source: Source) -> bytes:
    from room2dgs.export.mesh_files import ply

    return ply(source.hand_over, source.origin_m)


def _textured(source: Source) -> bytes:
    from room2dgs.export.texture.write import textured_glb

    return textured_glb(source)


def _textured_obj(source: Source, folder: Path) -> list[Path]:
    from room2dgs.export.texture.write import write_textured_obj

    return write_textured_obj(source, folder, source.offset_m(source.y_up))


def _points(source: Source) -> bytes:
    import numpy as np

    from room2dgs.export.point_cloud import point_ply

    centres = np.stack([frame.camera.centre for frame in source.scene.frames])
    comments = source.comments(np.eye(3), local=False)
    return point_ply(source.surfels, centres, comments, source.origin_m)


def _colmap(source: Source, folder: Path, text: bool) -> list[Path]:
    from room2dgs.export.colmap_model import write_colmap

    return write_colmap(source, folder, text)


def _transforms(source: Source, folder: Path) -> list[Path]:
    from room2dgs.export.transforms_json import write_transforms

    return write_transforms(source, folder)


def _inria(source: Source, folder: Path) -> list[Path]:
    from room2dgs.export.inria_folder import write_inria

    return write_inria(source, folder)


def _maps(encode: str, suffix: str) -> Callable[[Source, Path], list[Path]]:
    def write(source: Source, folder: Path) -> list[Path]:
        from room2dgs.export import depth_maps

        return depth_maps.write_maps(source, folder, getattr(depth_maps, encode), suffix)

    return write


_y_down, _y_up = partial(_local, axes="y_down"), partial(_local, axes="y_up")
_ALL = (
    Format("splats", "splats.ply", "Gaussians for every 3DGS viewer", _y_down(_splats), ("surfels",)),
    Format("splats_2dgs", "splats_2dgs.ply", "discs, for 2DGS tools alone", _y_down(_splats_2dgs), ("surfels",)),
    Format("splat", "splats.splat", "Gaussians of one colour each, for web viewers", _y_down(_splat), ("surfels",)),
    Format("spz", "splats.spz", "Gaussians, compressed: Scaniverse, Spark, SuperSplat", _y_up(_spz), ("surfels",)),
    Format("glb", "mesh.glb", "glTF: browsers, Windows, Blender, engines", _file(_glb), ("mesh",)),
    Format("obj", "mesh.obj", "everything", _file(_obj), ("mesh",)),
    Format("ply", "mesh.ply", "MeshLab, CloudCompare, Blender; the capture's own world", _file(_ply), ("mesh",)),
    Format("textured", "textured.glb", "few faces and a picture: web", _file(_textured), ("mesh", "xatlas")),
    Format("textured_obj", "textured_obj", "the same as OBJ, MTL, PNG", _textured_obj, ("mesh", "xatlas")),
    Format("points", "points.ply", "a point a surfel, with normals: CloudCompare", _file(_points), ("surfels",)),
    Format("depth", "depth", "16-bit PNG, millimetres, a view each", _maps("depth_png", ".png"), ("surfels",)),
    Format("depth_npy", "depth_npy", "float32, metres", _maps("depth_npy", ".npy"), ("surfels",)),
    Format("normals", "normals", "16-bit PNG, world frame", _maps("normal_png", ".png"), ("surfels",)),
    Format("normals_npy", "normals_npy", "float32, world frame", _maps("normal_npy", ".npy"), ("surfels",)),
    Format("colmap", "colmap", "the prepared capture for splat trainers", partial(_colmap, text=False), ()),
    Format("colmap_text", "colmap_text", "the same, readable", partial(_colmap, text=True), ()),
    Format("transforms", "transforms", "the same for nerfstudio", _transforms, ()),
    Format("inria", "inria", "the folder of the first splatting code: SIBR", _inria, ("surfels",)),
)  # fmt: skip
FORMATS = {one.name: one for one in _ALL}
