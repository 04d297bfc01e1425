"""The quality of a reconstruction, for a person who may film again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from room2dgs.prepare.contradictions import DOUBTFUL
from room2dgs.prepare.focal import focal_from_dict, focal_line
from room2dgs.prepare.metres import Scale
from room2dgs.prepare.photos import ChosenPhoto
from room2dgs.prepare.vanishing_points import RoomFrame

FEW_POINTS = 60  # of a photo
FEW_FEATURES = 500
# 95th over 5th percentile of the photos' scales; networks contradict themselves by up to 2 in a right model
CONTRADICTING_SCALES = 2.5
MUCH_BLURRED = 0.75  # of the median sharpness
SHORT_GAP = 2  # photos between two weak ones belong to one stretch
# A stretch that has to be filmed again lacks so many photos, or has so many that hang on little: single ones between
# good ones leave no hole.
LEAST_MISSING, LEAST_WEAK = 2, 3


def weak_stretches(
    photos: Sequence[ChosenPhoto], placed_points: dict[str, int], features: Sequence[int]
) -> list[dict[str, Any]]:
    """Parts of the capture that are missing or have few points, in order.

    Args:
        placed_points: of each placed photo, the points that it sees.
        features: of each photo.
    """
    weak = [placed_points.get(photo.name, 0) < FEW_POINTS for photo in photos]
    median = float(np.median([photo.sharpness for photo in photos]))
    stretches = []
    for first, last in _runs(weak):
        part = photos[first : last + 1]
        missing = sum(photo.name not in placed_points for photo in part)
        if missing < LEAST_MISSING and len(part) < LEAST_WEAK:
            continue
        if np.median(features[first : last + 1]) < FEW_FEATURES:
            why = "blank surfaces: keep furniture or edges in the picture"
        elif np.median([photo.sharpness for photo in part]) < MUCH_BLURRED * median:
            why = "blurred: move slower, with more light"
        else:
            why = "too little in common with the rest: move slower, come back to what was seen before"
        stretches.append(
            {
                "from": _place(part[0]),
                "to": _place(part[-1]),
                "photos": len(part),
                "not_placed": missing,
                "why": why,
            }
        )
    return stretches


def _runs(weak: Sequence[bool]) -> list[tuple[int, int]]:
    """(first, last) of runs, those with a short gap between them as one."""
    runs: list[tuple[int, int]] = []
    for index in np.flatnonzero(weak):
        if runs and index - runs[-1][1] <= SHORT_GAP:
            runs[-1] = runs[-1][0], int(index)
        else:
            runs.append((int(index), int(index)))
    return runs


def _place(photo: ChosenPhoto) -> str:
    return photo.name if photo.seconds is None else f"{photo.seconds:.1f} s"


def verdict_lines(verdict: dict[str, Any]) -> list[str]:
    """The verdict as sentences."""
    placed, count = verdict["placed"], verdict["photos"]
    lines = [
        f"placed: {placed} of {count} photos, {verdict['points']:,} points, each seen by {verdict['track_length']:.1f} "
        f"photos; reprojection error {verdict['reprojection_px']:.2f} px; "
        f"{focal_line(focal_from_dict(verdict['focal']))}"
    ]
    scale = verdict["scale"]
    if scale is None:
        lines.append("scale: unknown; give prepare.length=[height,METRES] of the cameras, and run it again")
    else:
        sure = "as given" if scale["sigma"] is None else f"+-{scale['sigma']:.0%}"
        lines.append(f"scale: by {WORDS[scale['source']]}, {sure} ({scale['words']})")
    lines.append(verdict["upright"])
    if verdict["height_m"] is not None:
        mend = (
            "; if the floor is that and you held it otherwise, give prepare.length=[height,METRES]"
            if scale["source"] == "network"
            else ""
        )
        lines.append(f"height: the cameras are {verdict['height_m']:.2f} m over the lowest level surface{mend}")
    lines += [f"WARNING: {doubt}" for doubt in verdict["warnings"]]
    for stretch in verdict["film_again"]:
        what = f"{stretch['not_placed']} of {stretch['photos']} photos not placed"
        if not stretch["not_placed"]:
            what = f"{stretch['photos']} photos hang on few points"
        lines.append(f"film again: {stretch['from']} to {stretch['to']}, {what}; {stretch['why']}")
    if not verdict["film_again"] and not verdict["warnings"]:
        lines.append("nothing has to be filmed again")
    if verdict["left_out"]:
        lines.append(f"left out: {', '.join(verdict['left_out'])}")
    return lines


def doubts(found: dict[str, Any] | None) -> list[str]:
    """A warning if too many matches contradict the poses."""
    if found is None or found["share"] < DOUBTFUL:
        return []
    pairs = ", ".join(f"{one} and {other}" for one, other in found["pairs"])
    return [
        f"{found['share']:.0%} of the pairs of photos that match contradict the poses ({pairs}): parts of the "
        "room may lie wrongly to each other; film what lies between them, or prepare the parts alone"
    ]


def scale_doubt(scale: Scale | None) -> str | None:
    """A warning if photos contradict each other on the room's size, as they do in a bent reconstruction."""
    if scale is None or scale.ratio is None or scale.ratio < CONTRADICTING_SCALES:
        return None
    return (
        f"photos contradict each other on the size of the room by {scale.ratio:.1f} times ({WORDS[scale.source]} "
        "beside the points): parts may have different scales; give scene.intrinsics if the focal length may be wrong, "
        "or film what lies between the parts"
    )


WORDS = {"sensor": "the sensor's depth", "length": "prepare.length", "network": "the depth network"}


def upright_line(frame: RoomFrame) -> str:
    """How the room was turned."""
    by = f"{frame.vertical_edges} upright edges" if frame.vertical_edges else "the way the camera was held"
    walls = "x and y run along the walls" if frame.walls else "edges do not agree on where walls face"
    return f"upright: z is up by {by}; {walls}"


def scale_dict(scale: Scale | None) -> dict[str, Any] | None:
    return None if scale is None else scale.as_dict()
