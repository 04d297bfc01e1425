"""Depth maps and masks that a capture's list names; a missing one does not cost its photo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from room2dgs.captures.capture import Shot
from room2dgs.captures.depth_maps import DepthMap
from room2dgs.captures.left_out import absence, left_out, some
from room2dgs.captures.photos import PhotoFile

MOST_MASKS_GONE = 0.5  # of the masks that are named


def without_missing_maps(shots: Sequence[Shot], path: Path) -> tuple[list[Shot], list[str]]:
    """Shots without depth maps and masks that are named and not there, and warnings of them.

    Args:
        path: the list.

    Raises:
        InputError: more than half of the masks are not there.
    """
    depths = {shot.name: shot.depth.label for shot in shots if isinstance(shot.depth, DepthMap)}
    masks = {shot.name: shot.mask.path for shot in shots if isinstance(shot.mask, PhotoFile)}
    no_depth = {name: file for name, file in depths.items() if absence(Path(file)) is not None}
    no_mask = {name: f"{file} is missing" for name, file in masks.items() if absence(file) is not None}
    warnings = []
    if no_depth:
        warnings.append(
            f"{path} names {len(depths)} depth maps, {len(no_depth)} of which are not there "
            f"({some(list(no_depth.values()))}); their photos are used without"
        )
    message = left_out(no_mask, len(masks), "masks that are named and not there", MOST_MASKS_GONE)
    if message:
        warnings.append(f"{path}: {message}; their photos are used whole")
    whole = [
        replace(
            shot,
            depth=None if shot.name in no_depth else shot.depth,
            mask=None if shot.name in no_mask else shot.mask,
        )
        for shot in shots
    ]
    return whole, warnings
