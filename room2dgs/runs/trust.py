"""How far the depth of each training view was trusted, in small maps that a run keeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.errors import InputError
from room2dgs.files import NUMPY_DAMAGE, whole_file
from room2dgs.geometry.low_res import low_res_width
from room2dgs.regular_files import open_regular

if TYPE_CHECKING:  # the package of depth takes torch along, and help is told without it
    from room2dgs.depth.completion.planes import Plane

FARTHEST_M = 60_000.0  # that the depth's 16 bits can say
ON_PLANE = 0.5  # least weight of a plane that a depth lies on
LARGEST = 1 << 20  # bytes of a map, which has 160 columns, and of a name


class Trust(NamedTuple):
    """One view's small maps.

    Attributes:
        confidence: (h, w) uint8, of 255: in the depth that the losses compare with; 0 = no depth.
        num_consistent: (h, w) uint8: how many consistent views stereo's depth counts as; 0 = none.
        depth: (h, w) float16 z-depth, metres, good to a thousandth; 0 = none. None in files that have it not.
        on_plane: (h, w) uint8, 1 where the depth lies on one of the room's planes. None likewise.
    """

    confidence: np.ndarray
    num_consistent: np.ndarray
    depth: np.ndarray | None = None
    on_plane: np.ndarray | None = None

    def sure_depth(self, least: float) -> np.ndarray:
        """(h, w) float32 the depth of a confidence, 0..1, of at least `least`; 0 elsewhere."""
        if self.depth is None:
            return np.zeros(self.confidence.shape, np.float32)
        return np.where(self.confidence >= 255 * least, self.depth.astype(np.float32), np.float32(0))


def write_trust(
    path: Path,
    frames: Sequence[Frame],
    maps: Mapping[str, ViewMaps],
    stereo: Mapping[str, tuple[np.ndarray, np.ndarray]],
    planes: Sequence[Plane] = (),
) -> None:
    """Keeps small maps of all views; no file where no view has depth.

    Args:
        frames: training views.
        maps: frame name -> priors.
        stereo: frame name -> depth, metres, and how many consistent views it counts as; may be empty.
        planes: of the room.
    """
    from room2dgs.depth.completion.on_planes import FLAT, on_planes

    arrays: dict[str, np.ndarray] = {}
    names: list[str] = []
    for frame in frames:
        found = maps.get(frame.name)
        if found is None or found.depth is None:
            continue
        confidence = (found.depth > 0).astype(np.float32)
        if found.depth_confidence is not None:
            confidence = np.clip(found.depth_confidence, 0, 1).astype(np.float32)
        camera = frame.camera.resized_to_width(low_res_width(frame.camera.width))
        small = camera.size
        confidence = cv2.resize(confidence, small, interpolation=cv2.INTER_AREA)
        small_depth = cv2.resize(found.depth.astype(np.float32), small, interpolation=cv2.INTER_NEAREST_EXACT)
        num_consistent = np.zeros(confidence.shape, np.uint8)
        if frame.name in stereo:
            depth, count = stereo[frame.name]
            count = np.where(depth > 0, np.minimum(count, 255), 0).astype(np.uint8)
            num_consistent = cv2.resize(count, small, interpolation=cv2.INTER_NEAREST_EXACT)
        least = confidence > 0  # of a depth that hardly anything speaks for, too
        arrays[f"{len(names)}/confidence"] = np.maximum(np.round(confidence * 255), least).astype(np.uint8)
        arrays[f"{len(names)}/agreeing"] = num_consistent
        arrays[f"{len(names)}/depth"] = np.minimum(small_depth, FARTHEST_M).astype(np.float16)
        if found.normal is not None:
            normal = cv2.resize(found.normal, small, interpolation=cv2.INTER_NEAREST_EXACT)
            on_plane = on_planes(small_depth, normal, camera, planes, FLAT).weight > ON_PLANE
            arrays[f"{len(names)}/on_plane"] = on_plane.astype(np.uint8)
        names.append(frame.name)
    path.unlink(missing_ok=True)
    if names:
        with whole_file(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, **{"names": np.array(names), **arrays})  # type: ignore[arg-type]


def read_trust(path: Path) -> dict[str, Trust]:
    """Frame name -> maps; none without the file, or when it is damaged or no such file: the page does without."""
    try:
        with open_regular(path) as raw, np.load(raw, allow_pickle=False) as file:
            if not _is_small(file):
                return {}
            names = [str(name) for name in file["names"]]
            maps = [_of_view(file, index) for index in range(len(names))]
    except (InputError, *NUMPY_DAMAGE):
        return {}
    return dict(zip(names, maps, strict=True)) if all(map(_fits, maps)) else {}


def _of_view(file: np.lib.npyio.NpzFile, index: int) -> Trust:
    optional = (file.get(f"{index}/{name}") for name in ("depth", "on_plane"))
    return Trust(file[f"{index}/confidence"], file[f"{index}/agreeing"], *optional)


def _is_small(file: np.lib.npyio.NpzFile) -> bool:
    """Whether each map, unpacked, has no more bytes than a small map can: what is packed may be of any size."""
    assert file.zip is not None  # it is open
    sizes = {info.filename: info.file_size for info in file.zip.infolist()}
    names = sizes.pop("names.npy", 0)
    return names <= LARGEST * (1 + len(sizes)) and all(size <= LARGEST for size in sizes.values())


def _fits(maps: Trust) -> bool:
    whole = all(one.dtype == np.uint8 and one.ndim == 2 and one.size for one in maps[:2])
    if not whole or maps.confidence.shape != maps.num_consistent.shape:
        return False
    others = ((maps.depth, np.float16), (maps.on_plane, np.uint8))
    return all(one is None or (one.dtype == kind and one.shape == maps.confidence.shape) for one, kind in others)
