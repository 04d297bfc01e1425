"""How much of a scene its masks hide, and whether masks seem inverted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from room2dgs.captures.capture_points import CapturePoints
from room2dgs.captures.mask_images import OPAQUE, SMALL, MaskFacts
from room2dgs.captures.scene import Frame, Scene
from room2dgs.errors import InputError

NEARLY_ALL = 0.9  # share of the pixels; a room is hardly told by what is left
MOST = 0.6  # hidden, with the borders of the photos: what is left are blobs, as people and things are
MUCH = 0.2  # hidden: less does not ask for a look at the points
ENOUGH_SEEN = 100  # observations of points
WHITE = "white is what may be used"


class Hidden(NamedTuple):
    """Of one view.

    Attributes:
        usable: (36, 48) bool, the photo made small.
        any_usable: of all pixels.
    """

    usable: np.ndarray
    any_usable: bool


def hidden_of(frame: Frame, alpha: MaskFacts | None) -> Hidden | None:
    """What a view's mask and alpha hide; None: it has neither.

    Args:
        alpha: facts of the photo's alpha as of a mask; None: its pixels are opaque.
    """
    parts = []
    masks = frame.masks
    facts = masks.facts().get(frame.mask_photo) if masks and frame.mask_photo is not None else None
    if masks and isinstance(facts, MaskFacts):
        rule = masks.rule
        parts.append((rule.usable(facts.small), bool(rule.usable(facts.brightest).any())))
    if alpha is not None:
        parts.append((alpha.small.values > OPAQUE, bool(alpha.brightest.values.max() > OPAQUE)))
    if not parts:
        return None
    return Hidden(np.logical_and.reduce([usable for usable, _ in parts]), all(any_usable for _, any_usable in parts))


def hidden_notes(scene: Scene, hidden: Mapping[str, Hidden]) -> tuple[list[str], list[str]]:
    """Notes and warnings.

    Args:
        hidden: by frame name, of the frames that have a mask or transparent pixels.

    Raises:
        InputError: nothing of any photo may be used.
    """
    if not hidden:
        return [], []
    frames = scene.frames
    masked = any(frame.mask_photo is not None for frame in frames)
    what = "masks hide" if masked else "transparent pixels (the alpha of the photos) hide"
    mend = f"{WHITE}: invert the masks if they mean the opposite" if masked else "save the photos without alpha"
    share = 1.0 - float(np.mean([one.usable.mean() for one in hidden.values()]))
    if len(hidden) == len(frames) and not any(one.any_usable for one in hidden.values()):
        raise InputError(f"{scene.path} has nothing to be used: {what} 100% of the pixels of all photos; {mend}")
    notes = [f"{what} {share:.0%} of the pixels of {len(hidden)} photos; what they hide is not used"]
    if share > NEARLY_ALL:
        return notes, [f"{what} {share:.1%} of the pixels of {len(hidden)} photos; {mend}"]
    if not masked or share < MUCH:
        return notes, []
    seen = _hidden_of_what_is_seen(scene, hidden)
    if seen is not None and seen > max(MOST, share):
        return notes, [
            f"masks look inverted: of what several photos see the same (the capture's points) they hide {seen:.0%}; "
            f"{mend}"
        ]
    if seen is None and share > MOST and _leave_blobs(hidden):
        return notes, [
            f"masks look inverted: they hide {share:.0%} of the pixels, the borders of the photos among them, and "
            f"leave single things; {mend}"
        ]
    return notes, []


def _leave_blobs(hidden: Mapping[str, Hidden]) -> bool:
    """Whether most masks hide the photos' borders and leave something in between."""
    left = [one.usable for one in hidden.values() if one.any_usable]
    borders = [np.concatenate([one[0], one[-1], one[:, 0], one[:, -1]]).mean() for one in left]
    return bool(borders) and float(np.median(borders)) < 1.0 - NEARLY_ALL


def _hidden_of_what_is_seen(scene: Scene, hidden: Mapping[str, Hidden]) -> float | None:
    """Share of the observations of the capture's points that lie in hidden pixels; None: it has too few."""
    points = scene.given_points
    if not isinstance(points, CapturePoints):
        return None
    try:
        observations = points.observations()
    except InputError:  # who uses the points tells
        return None
    count = under = 0
    for name, at in observations:
        if name not in hidden:
            continue
        column, row = np.floor(at * SMALL).astype(np.int64).clip(0, np.array(SMALL) - 1).T
        count += len(at)
        under += int((~hidden[name].usable[row, column]).sum())
    return under / count if count >= ENOUGH_SEEN else None
