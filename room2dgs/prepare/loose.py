"""Photos that are connected to a model by too few points for a sure pose."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

from room2dgs.colmap import pycolmap

TIED = 25  # points that two photos share when they belong together
# A group is connected to the rest if they share half of its points, at least the first and at most the second number.
CONNECTED = (20, 60)


def loose_photos(model: pycolmap.Reconstruction) -> list[int]:
    """Image ids of groups of photos that are not connected well to the largest group.

    Two photos of a blank wall may match each other and be registered by a handful of wrong matches.
    """
    tracks = [
        sorted({element.image_id for element in point.track.elements}) for _, point in sorted(model.points3D.items())
    ]
    shared: Counter[tuple[int, int]] = Counter()
    for track in tracks:
        shared.update(combinations(track, 2))
    groups = _groups(sorted(model.reg_image_ids()), [pair for pair, count in shared.items() if count >= TIED])
    connected, *others = sorted(groups, key=lambda group: (-len(group), min(group)))
    connected = set(connected)
    while True:
        joined = [group for group in others if _is_connected(group, connected, tracks)]
        if not joined:
            return sorted(image_id for group in others for image_id in group)
        for group in joined:
            connected |= group
            others.remove(group)


def _is_connected(group: set[int], connected: set[int], tracks: list[list[int]]) -> bool:
    # a wrong match makes a point of two photos; what two of the rest see already was a point before
    own = [len(connected.intersection(track)) >= 2 for track in tracks if not group.isdisjoint(track)]
    return sum(own) >= max(CONNECTED[0], min(CONNECTED[1], len(own) / 2))


def _groups(ids: list[int], pairs: list[tuple[int, int]]) -> list[set[int]]:
    """Connected components of the graph of some pairs."""
    group = {image_id: {image_id} for image_id in ids}
    for first, second in pairs:
        if group[first] is not group[second]:
            group[first] |= group[second]
            for image_id in group[second]:
                group[image_id] = group[first]
    return list({id(one): one for one in group.values()}.values())


def remove_photos(model: pycolmap.Reconstruction, image_ids: list[int]) -> None:
    """Remove photos and the points that only they observe."""
    for image_id in image_ids:
        model.deregister_frame(model.image(image_id).frame_id)
