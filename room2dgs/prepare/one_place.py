"""Whether a camera only turned: by the kinds of its pairs of photos, and by the reconstruction where there is one."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from room2dgs.colmap import pycolmap
from room2dgs.sfm.one_place import ONE_PLACE_OF_DEPTH, WALK

TURNED, FLAT = "PANORAMIC", "PLANAR_OR_PANORAMIC"  # pairs whose pictures a homography explains
MIN_MATCHES = 15  # of a pair that tells anything
Pairs = Mapping[tuple[int, int], tuple[int, str]]  # photos in the order of filming -> number of matches, their kind


def without_parallax(pairs: Pairs, kinds: Collection[str]) -> bool:
    """Whether most pairs of photos are of these kinds, and so are most of those farthest apart.

    Neighbours in a slow walk have no parallax, either; a photo and the last one that shows the same have.
    """
    good = {pair: kind in kinds for pair, (count, kind) in pairs.items() if count >= MIN_MATCHES}
    farthest: dict[int, tuple[int, int]] = {}
    for first, last in good:
        for photo in (first, last):
            known = farthest.get(photo, (0, 0))
            farthest[photo] = max((first, last), known, key=lambda pair: abs(pair[1] - pair[0]))
    return _most(list(good.values())) and _most([good[pair] for pair in set(farthest.values())])


def walked(model: pycolmap.Reconstruction) -> bool:
    """Whether the cameras of a reconstruction stand apart, beside the distance of what they see."""
    images = [model.image(image_id) for image_id in model.reg_image_ids()]
    centres = np.array([image.projection_center() for image in images])
    depths = [
        float((image.cam_from_world() * model.point3D(point.point3D_id).xyz)[2])
        for image in images
        for point in image.get_observation_points2D()
    ]
    reach = float(np.linalg.norm(np.ptp(centres, axis=0)))
    return bool(depths) and reach >= ONE_PLACE_OF_DEPTH * float(np.median(depths))


def why_small_angles(source: str, angle_deg: float, cameras_walked: bool) -> str:
    """The sentence for a reconstruction whose median point is seen under `angle_deg`."""
    seen = f"its points are seen under {angle_deg:.1f} degrees"
    if not cameras_walked:
        return f"{source} was taken from one place ({seen}), so no depth can be told; {WALK}"
    return (
        f"{source} shows each thing from nearly one place alone ({seen}, though the camera walked), so no depth can be "
        "told; film the same things again from the side, or give scene.intrinsics if the focal length may be wrong"
    )


def hardly_walked() -> str:
    """The warning for a reconstruction whose cameras stand in one place beside the distance of what they see."""
    return f"all photos were taken from nearly one place, so depth is little more than a guess; {WALK}"


def why_no_parallax(source: str, pairs: Pairs) -> str | None:
    """The sentence for photos that gave no reconstruction and whose pairs homographies explain; None: they do not."""
    if without_parallax(pairs, {TURNED}):
        return f"{source} was taken from one place (the camera only turns), so no depth can be told; {WALK}"
    if without_parallax(pairs, {TURNED, FLAT}):
        return (
            f"{source} was taken from one place, or shows one flat wall, so no depth can be told; film with steps to "
            "the side and with corners or furniture in the picture"
        )
    return None


def _most(of: list[bool]) -> bool:
    return sum(of) > len(of) / 2
