"""Masks in a folder of their own, paired with photos by name."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePosixPath

from room2dgs.captures.listing import listed, natural
from room2dgs.captures.photo_names import in_folder, shared_stems

FOLDER = re.compile(r"masks?|masks?[_-].+|.+[_-]masks?", re.IGNORECASE)
ENDINGS = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")
# What a mask is called, of the photo's name with its suffix ({name}: COLMAP's) and without ({stem}: nerfstudio's).
PATTERNS = (
    "{name}", "{stem}", "{stem}_mask", "{name}_mask", "mask_{stem}", "{stem}.mask", "{name}.mask", "{stem}-mask",
)  # fmt: skip


def mask_folders(places: Iterable[Path]) -> list[Path]:
    """Folders whose name says masks, in some places; masks/ and mask/ first."""
    found: dict[Path, None] = {}
    for place in places:
        names = natural(name for name in listed(place) if FOLDER.fullmatch(name))
        for name in sorted(names, key=lambda name: (name != "masks", name != "mask")):
            if (place / name).is_dir():
                found[place / name] = None
    return list(found)


def fitting_masks(folders: Sequence[Path], photos: Sequence[str]) -> tuple[Path | None, dict[str, Path]]:
    """The folder that has masks of most photos, the first of several, and the photo's name -> its mask.

    Args:
        photos: names relative to their folder.
    """
    best: tuple[Path | None, dict[str, Path]] = (None, {})
    for folder in folders:
        masks = mask_files(folder, photos)
        if len(masks) > len(best[1]):
            best = folder, masks
    return best


def mask_files(folder: Path, photos: Sequence[str]) -> dict[str, Path]:
    """Photo's name -> its mask, by the one way of naming that fits most photos.

    Masks lie in the photos' folders, mirrored, or flat, where no two photos have one stem.

    Args:
        photos: names relative to their folder.
    """
    files = set(in_folder(folder)) if folder.is_dir() else set()
    if not files:
        return {}
    shared = shared_stems(photos)
    best: dict[str, Path] = {}
    for flat in (False, True):
        for pattern in PATTERNS:
            for ending in ENDINGS:
                found = {}
                for photo in photos:
                    path = PurePosixPath(photo.replace("\\", "/"))
                    if flat and (path.stem in shared or path.parent == PurePosixPath(".")):
                        continue
                    named = pattern.format(name=path.name, stem=path.stem) + ending
                    mask = named if flat else str(path.parent / named)
                    if mask in files:
                        found[photo] = folder / mask
                if len(found) > len(best):
                    best = found
                if len(best) == len(photos):
                    return best
    return best
