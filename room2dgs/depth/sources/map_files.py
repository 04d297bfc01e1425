"""Maps on disk as a proposal, whoever wrote them: the user or a network's cache."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.scene import Frame
from room2dgs.captures.uncertainty import measured_weight
from room2dgs.config import DepthPriorConfig, NormalPriorConfig
from room2dgs.depth.align.one_view import RawMap
from room2dgs.depth.files import read_depth, read_normal
from room2dgs.depth.network.map_cache import SUFFIX, has_array, read_array
from room2dgs.depth.sources.source import NormalMap, NormalMaps, Proposal, SourceInput


def proposal_of_files(given: SourceInput, files: Mapping[str, Path], doubts: bool = False) -> Proposal:
    """Depth maps on disk.

    Args:
        files: frame name -> map; frames may have none.
        doubts: the maps' errors only rank their pixels (`Proposal.doubts`).

    Raises:
        InputError: a damaged file.
    """
    raw: LazyMaps[RawMap] = LazyMaps()
    sigmas: LazyMaps[np.ndarray] = LazyMaps()
    for frame in given.frames:
        if frame.name in files:
            path = files[frame.name]
            raw.add(frame.name, partial(_raw_map, path, given.prior.depth, frame, doubts))
            if has_sigma(path):
                sigmas.add(frame.name, partial(_sigma, path))
    if doubts:
        return Proposal(given.prior, raw=raw, doubts=sigmas, models=given.models)
    return Proposal(given.prior, raw=raw, sigmas=sigmas, models=given.models)


def normals_of_files(given: SourceInput, files: Mapping[str, Path]) -> NormalMaps:
    """Normal maps on disk; likewise."""
    found: LazyMaps[NormalMap] = LazyMaps()
    for frame in given.frames:
        if frame.name in files:
            found.add(frame.name, partial(_normal_map, files[frame.name], given.prior.normal, frame))
    return found


def has_sigma(path: Path) -> bool:
    """Whether a map on disk has expected errors: files of the user and of other networks have none.

    Raises:
        InputError: a damaged file.
    """
    return path.suffix == SUFFIX and has_array(path, "error")


def read_sigma(path: Path) -> np.ndarray | None:
    """(H, W) float32 expected error, of ln depth or in radians; None for maps without.

    Raises:
        InputError: a damaged file.
    """
    return read_array(path, "error") if path.suffix == SUFFIX else None


def _sigma(path: Path) -> np.ndarray:
    sigma = read_sigma(path)
    assert sigma is not None
    return sigma


def _raw_map(path: Path, settings: DepthPriorConfig, frame: Frame, doubts: bool) -> RawMap:
    values, valid = read_depth(path, settings, frame.camera)
    sigma = None if doubts else read_sigma(path)
    if sigma is None:
        return RawMap(values, valid)
    return RawMap(values, valid & (measured_weight(sigma, settings.error_scale, settings.max_error) > 0))


def _normal_map(path: Path, settings: NormalPriorConfig, frame: Frame) -> NormalMap:
    return NormalMap(*read_normal(path, settings, frame.camera), read_sigma(path))
