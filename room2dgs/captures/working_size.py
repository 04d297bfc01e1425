"""The size at which photos are worked: `scene.image_width`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias

from room2dgs.geometry.camera import Camera

ImageWidth: TypeAlias = "int | Literal['auto', 'full']"
# "auto" works photos whose longer side is longer at this, as the program of 3D Gaussian Splatting does
LARGE_PX = 1600


def resized_camera(camera: Camera, image_width: ImageWidth, wide: bool) -> Camera:
    """The camera at the working size; photos are never enlarged: that adds work and no detail.

    Args:
        image_width: pixels; "full": all; "auto": the longer side is at most `LARGE_PX`.
        wide: there are photos that are wider than high; then those that stand upright get the width as their height.
    """
    if image_width == "full":
        return camera
    upright = camera.height > camera.width
    if image_width == "auto":
        image_width, wide = LARGE_PX, True
    if wide and upright:
        if image_width >= camera.height:
            return camera
        return camera.resized(max(1, round(camera.width * image_width / camera.height)), image_width)
    return camera if image_width >= camera.width else camera.resized_to_width(image_width)


def size_note(sizes: Sequence[tuple[int, int]], image_width: ImageWidth) -> list[str]:
    """What a person should know of photos that are worked smaller without having been asked for it.

    Args:
        sizes: (width, height) of each photo.
    """
    large = [max(size) for size in sizes if max(size) > LARGE_PX]
    if image_width != "auto" or not large:
        return []
    some = "photos" if len(large) == len(sizes) else f"{len(large)} of {len(sizes)} photos"
    pixels = f"{max(large)} px" if min(large) == max(large) else f"{min(large)} to {max(large)} px"
    return [f"{some} of {pixels} are worked at {LARGE_PX} px; scene.image_width=full uses all pixels"]
