"""All layouts that are read, in the order in which they are asked whether a capture is theirs."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from room2dgs.captures.capture import Capture
from room2dgs.captures.listing import Listing
from room2dgs.captures.readers import (
    arkitscenes,
    colmap,
    metashape,
    monosdf,
    nerfstudio,
    neuralrgbd,
    open3d_log,
    polycam,
    record3d,
    replica,
    ros,
    scannet,
    scannetpp,
    sdfstudio,
    sens,
    sevenscenes,
    stray,
    tum,
)
from room2dgs.captures.readers.not_known import not_known
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError


class Reader(NamedTuple):
    """A layout.

    Attributes:
        name: as `scene.layout` has it.
        is_it: whether a folder's names look like it.
        read: the capture of a path and its settings; raises InputError.
        needs: what is on disk, in words.
        contains: layouts that folders of this one look like too, because they contain their files.
    """

    name: str
    is_it: Callable[[Listing], bool]
    read: Callable[..., Capture]
    needs: str
    contains: tuple[str, ...] = ()


READERS: dict[str, Reader] = {
    reader.name: reader
    for reader in (
        Reader("sens", sens.is_sens, sens.read_sens, sens.LAYOUT),
        Reader("ros", ros.is_ros, ros.read_ros, ros.LAYOUT),
        Reader("record3d", record3d.is_record3d, record3d.read_record3d, record3d.LAYOUT),
        Reader(
            "scannetpp", scannetpp.is_scannetpp, scannetpp.read_scannetpp, scannetpp.LAYOUT, ("colmap", "nerfstudio")
        ),
        Reader("polycam", polycam.is_polycam, polycam.read_polycam, polycam.LAYOUT, ("nerfstudio",)),
        Reader("stray", stray.is_stray, stray.read_stray, stray.LAYOUT),
        Reader("arkitscenes", arkitscenes.is_arkitscenes, arkitscenes.read_arkitscenes, arkitscenes.LAYOUT),
        Reader("scannet", scannet.is_scannet, scannet.read_scannet, scannet.LAYOUT),
        Reader("replica", replica.is_replica, replica.read_replica, replica.LAYOUT),
        Reader("tum", tum.is_tum, tum.read_tum, tum.LAYOUT),
        Reader("sevenscenes", sevenscenes.is_sevenscenes, sevenscenes.read_sevenscenes, sevenscenes.LAYOUT),
        Reader("monosdf", monosdf.is_monosdf, monosdf.read_monosdf, monosdf.LAYOUT),
        Reader("sdfstudio", sdfstudio.is_sdfstudio, sdfstudio.read_sdfstudio, sdfstudio.LAYOUT),
        Reader("nerfstudio", nerfstudio.is_nerfstudio, nerfstudio.read_nerfstudio, nerfstudio.LAYOUT, ("colmap",)),
        Reader("neuralrgbd", neuralrgbd.is_neuralrgbd, neuralrgbd.read_neuralrgbd, neuralrgbd.LAYOUT),
        Reader("colmap", colmap.is_colmap, colmap.read_colmap, colmap.LAYOUT),
        Reader("open3d", open3d_log.is_open3d, open3d_log.read_open3d, open3d_log.LAYOUT),
        Reader("metashape", metashape.is_metashape, metashape.read_metashape, metashape.LAYOUT),
    )
}


def reader_of(config: SceneConfig, files: Listing) -> Reader:
    """The reader that the settings name, or the one that a capture's names call for.

    Raises:
        InputError: none does, or several do.
    """
    if config.layout != "auto":
        return READERS[config.layout]
    found = fitting(files)
    if len(found) > 1:
        names = " and ".join(reader.name for reader in found)
        raise InputError(
            f"{files.root} looks like {names}; say which with "
            + " or ".join(f"scene.layout={reader.name}" for reader in found)
        )
    if not found:
        raise not_known(files, _names, scannet.LAYOUT)
    return found[0]


def fitting(files: Listing) -> list[Reader]:
    """The readers of the layouts that a folder's or file's names look like."""
    found = [reader for reader in READERS.values() if reader.is_it(files)]
    inner = {name for reader in found for name in reader.contains}
    return [reader for reader in found if reader.name not in inner]


def _names(files: Listing) -> str | None:
    """Of the layouts that fit, in words."""
    return " or ".join(reader.name for reader in fitting(files)) or None
