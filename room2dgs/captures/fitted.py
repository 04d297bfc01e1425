"""Checks that photos fit their intrinsics, masks and depth maps, and scales intrinsics to the photos."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from room2dgs.captures.capture import Capture, Shot, file_name, pinhole_lens
from room2dgs.captures.depth_maps import DepthMap
from room2dgs.captures.entry import Entry
from room2dgs.captures.image_files import depth_size
from room2dgs.captures.left_out import left_out
from room2dgs.captures.lens import Lens
from room2dgs.captures.photo_header import PhotoHeader, header_of
from room2dgs.captures.photos import Photo
from room2dgs.captures.principal_point import check_principal_point
from room2dgs.captures.scene import Dropped
from room2dgs.captures.shapes import check_shape, same_shape
from room2dgs.captures.turned_photo import ON_ITS_SIDE, TurnedPhoto, turned_size
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.parallel_map import parallel_map

RESIZED = 0.02  # relative difference of the factors by which width and height were resized
NOT_TURNED = "(EXIF of the photo says that it is to be turned, which was not done)"


class _Headers(NamedTuple):
    photo: PhotoHeader
    mask: PhotoHeader | None


@dataclass
class _Messages:
    """What a person should know: photos by what was done about their orientation, and warnings of intrinsics."""

    turned: list[str] = field(default_factory=list)
    stored: list[str] = field(default_factory=list)
    unsure: list[str] = field(default_factory=list)
    cropped: list[str] = field(default_factory=list)

    def notes(self) -> list[str]:
        found = []
        if self.turned:
            found.append(
                f"orientation: {len(self.turned)} photos are turned as their EXIF says, because their intrinsics are "
                "for the turned ones"
            )
        if self.stored:
            found.append(
                f"orientation: {len(self.stored)} photos have an EXIF orientation that is not applied, because their "
                "intrinsics fit the pixels as they are stored"
            )
        return found

    def warnings(self) -> list[str]:
        found = []
        if self.unsure:
            found.append(
                f"{len(self.unsure)} photos have an EXIF orientation ({self.unsure[0]} is the first), and nothing "
                "tells whether their intrinsics are for the turned ones: pixels are read as they are stored; if the "
                "room looks wrong, save the photos turned and without the tag"
            )
        if self.cropped:
            more = f" (so are those of {len(self.cropped) - 1} other photos)" if len(self.cropped) > 1 else ""
            found.append(self.cropped[0] + more)
        return found


def fitted(
    capture: Capture, entries: Sequence[Entry], config: SceneConfig
) -> tuple[list[Entry], list[Dropped], list[str], list[str]]:
    """Entries with photos, masks, sizes and lenses that fit each other; those left out; notes; warnings.

    Headers are read alone. Depth maps that are the photo's camera's have the photo's shape, and so have masks.

    Raises:
        InputError: too many photos or masks that cannot be read, that have no intrinsics or a size that contradicts
            them, or a map of another shape than the photo.
    """
    headers = list(parallel_map(_headers, (entry.shot for entry in entries)))
    bad = {
        entry.shot.name: str(found)
        for entry, found in zip(entries, headers, strict=True)
        if isinstance(found, InputError)
    }
    told = [left_out(bad, len(entries), "photos that cannot be read")]
    messages = _Messages()
    readable = [
        (entry, found) for entry, found in zip(entries, headers, strict=True) if not isinstance(found, InputError)
    ]
    usual = _usual_sizes(readable)
    good, odd = [], {}
    for entry, found in readable:
        try:
            good.append(_fitted(capture, entry, found, config, usual, messages))
        except InputError as error:
            odd[entry.shot.name] = str(error)
    other_depth = _other_depths(good, {*messages.stored, *messages.unsure})
    good = [entry for entry in good if entry.shot.name not in other_depth]
    told.append(left_out(odd | other_depth, len(entries), "photos that do not fit their intrinsics, masks or depth"))
    dropped = [Dropped(file_name(name), why) for name, why in (bad | odd | other_depth).items()]
    return good, dropped, messages.notes(), [*(one for one in told if one), *messages.warnings()]


def _usual_sizes(entries: Sequence[tuple[Entry, _Headers]]) -> dict[int, tuple[str, tuple[int, int]]]:
    """`id` of each lens that knows no size -> the size of most of its photos, and the first one that has it."""
    seen: dict[int, list[tuple[tuple[int, int], str]]] = {}
    for entry, found in entries:
        if entry.shot.lens is not None and entry.shot.lens.size is None:
            seen.setdefault(id(entry.shot.lens), []).append((found.photo.size, entry.shot.path.name))
    usual = {lens: Counter(size for size, _ in sizes).most_common(1)[0][0] for lens, sizes in seen.items()}
    return {
        lens: (next(name for one, name in sizes if one == usual[lens]), usual[lens]) for lens, sizes in seen.items()
    }


def _headers(shot: Shot) -> _Headers | InputError:
    try:
        return _Headers(header_of(shot.source), None if shot.mask is None else header_of(shot.mask))
    except InputError as error:
        return error


def _fitted(
    capture: Capture,
    entry: Entry,
    headers: _Headers,
    config: SceneConfig,
    usual: dict[int, tuple[str, tuple[int, int]]],
    messages: _Messages,
) -> Entry:
    """One entry.

    Args:
        usual: what `_usual_sizes` gives.
    """
    shot, header = entry.shot, headers.photo
    given = config.intrinsics
    lens = shot.lens
    if given is not None:
        fx, fy, cx, cy = given
        lens = pinhole_lens(fx, fy, cx, cy, None, "scene.intrinsics", config.pixel_centres != "integer")
    size, photo = header.size, shot.photo
    if _to_be_turned(lens, header, shot.path.name, messages):
        size, photo = turned_size(size, header.orientation), TurnedPhoto(shot.source, header.orientation)
    if lens is None:
        others = any(one.lens for one in capture.shots)
        whose = f"{shot.path}, unlike other photos, has" if others else f"{capture.root} brings"
        raise InputError(
            f"{whose} no intrinsics; give scene.intrinsics=[fx,fy,cx,cy] in pixels of the photos ({size[0]}x{size[1]})"
        )
    sure = given is not None or lens.size == size
    try:
        if lens.size is None:
            other, known = usual.get(id(shot.lens), (shot.path.name, size))
            if size != known:
                raise InputError(
                    f"{shot.path} has {size[0]}x{size[1]} pixels and {other} has "
                    f"{known[0]}x{known[1]}, but they share intrinsics; give all photos one size"
                )
            lens = replace(lens, size=size)
        elif lens.size != size:
            lens = _scaled(lens, size, shot)
        doubt = check_principal_point(lens, sure)
        mask = None
        if shot.mask is not None and headers.mask is not None:
            mask = _mask(shot.mask, headers.mask, size)
    except InputError as error:
        if header.orientation == 1 or photo is not shot.photo:
            raise
        raise InputError(f"{error} {NOT_TURNED}") from error
    if doubt:
        messages.cropped.append(doubt)
    return replace(entry, lens=lens, size=size, photo=photo, mask=mask, transparent=header.transparent)


def _to_be_turned(lens: Lens | None, header: PhotoHeader, name: str, messages: _Messages) -> bool:
    """Whether the intrinsics are for the photo as its EXIF orientation turns it; the size tells, if anything does."""
    if header.orientation == 1:
        return False
    if lens is None or lens.size is None:
        messages.unsure.append(name)
        return False
    turned = turned_size(header.size, header.orientation)
    as_stored, as_turned = _resized(lens.size, header.size), _resized(lens.size, turned)
    if as_turned and not as_stored:
        messages.turned.append(name)
        return True
    if as_stored:
        square = header.orientation >= ON_ITS_SIDE and as_turned
        (messages.unsure if square else messages.stored).append(name)
    return False


def _resized(one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Is one the other, made larger or smaller?"""
    return abs(one[0] * other[1] / (one[1] * other[0]) - 1.0) <= RESIZED


def _scaled(lens: Lens, size: tuple[int, int], shot: Shot) -> Lens:
    """Intrinsics of a photo that was resized after they were written."""
    width, height = lens.known_size
    if not _resized(size, (width, height)):
        raise InputError(
            f"{shot.path} has {size[0]}x{size[1]} pixels, but its intrinsics are for {width}x{height}; "
            "give the intrinsics of this image size as scene.intrinsics=[fx,fy,cx,cy], or the photos that they are for"
        )
    return lens.scaled_to(size)


def _mask(mask: Photo, header: PhotoHeader, size: tuple[int, int]) -> Photo:
    """A mask of the photo's shape; it may have an orientation of its own."""
    turned = turned_size(header.size, header.orientation)
    if not same_shape(header.size, size) and same_shape(turned, size):
        return TurnedPhoto(mask, header.orientation)
    label = getattr(mask, "path", None) or getattr(mask, "label", None) or "a mask"
    check_shape(label, "masks", header.size, size, "make masks of the photos' shape or delete them")
    return mask


def _other_depths(entries: Sequence[Entry], not_turned: set[str]) -> dict[str, str]:
    """Name -> sentence of photos whose depth is their own camera's and has another shape than they; whoever reads a
    map that is not whole tells.

    Args:
        not_turned: names of photos with an EXIF orientation that is not applied.
    """
    present = [(entry, entry.shot.depth) for entry in entries if entry.shot.depth is not None]
    sizes = list(parallel_map(_depth_size, (depth for _, depth in present)))
    found = {}
    for (entry, depth), size in zip(present, sizes, strict=True):
        if size is not None:
            label = depth if isinstance(depth, Path) else depth.label
            mend = "register depth to colour or delete the depth folder"
            try:
                check_shape(label, "depth maps", size, entry.size, mend)
            except InputError as error:
                said = str(error)
                found[entry.shot.name] = f"{said} {NOT_TURNED}" if entry.shot.path.name in not_turned else said
    return found


def _depth_size(depth: DepthMap | Path) -> tuple[int, int] | None:
    """(width, height) of a map that shows what the photo shows; None: it has a camera of its own, or is damaged."""
    if isinstance(depth, Path):
        return depth_size(depth)
    return depth.size() if depth.K is None or depth.K_size is not None else None
