"""The user's own maps as a source: a folder with a map for each photo."""

from __future__ import annotations

from pathlib import Path

from room2dgs.depth.files import find_map
from room2dgs.depth.sources.map_files import normals_of_files, proposal_of_files
from room2dgs.depth.sources.source import DepthSource, NormalMaps, Proposal, SourceInput
from room2dgs.errors import InputError
from room2dgs.texts import some_of


def _depth(given: SourceInput) -> Proposal:
    return proposal_of_files(given, _found(given, "depth", given.prior.depth.path))


def _normals(given: SourceInput) -> NormalMaps:
    return normals_of_files(given, _found(given, "normal", given.prior.normal.path))


def _found(given: SourceInput, kind: str, path: str | None) -> dict[str, Path]:
    """Frame name -> file; the missing ones are logged."""
    folder = Path(path or "")
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give prior.{kind}.path=DIR with a map for each photo")
    found = {frame.name: file for frame in given.frames if (file := find_map(folder, frame))}
    if not found:
        raise InputError(
            f"{folder} has no map for any of the {len(given.frames)} views; name them as the views, "
            f"for example {given.frames[0].name}.png or .npy"
        )
    missing = [frame.name for frame in given.frames if frame.name not in found]
    if missing:
        given.log(f"{kind} prior: no map for {len(missing)} of {len(given.frames)} views: {some_of(missing)}")
    return found


FILES = DepthSource(_depth, _normals)
