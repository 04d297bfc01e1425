"""Checks that maps have the aspect ratio of their photos, since they are resized and never stretched or turned."""

from __future__ import annotations

from room2dgs.errors import InputError

# Relative difference of the aspect ratios. Sensors' maps are cut by a few pixels.
MAX_MISMATCH = 0.05


def check_shape(label: object, what: str, size: tuple[int, int], photo: tuple[int, int], mend: str) -> None:
    """Refuse a map that is no scaled picture of its photo.

    Args:
        label: what messages call the map; what: its kind ("depth maps", "masks").
        size, photo: (width, height).
        mend: what to do about a map that is cropped or squeezed.

    Raises:
        InputError: the aspect ratios differ.
    """
    if same_shape(size, photo):
        return
    (width, height), (photo_width, photo_height) = size, photo
    if same_shape((height, width), photo):
        raise InputError(
            f"{label} lies on its side: {width}x{height} pixels beside a photo of {photo_width}x{photo_height}; turn "
            f"the {what}"
        )
    raise InputError(
        f"{label} has {width}x{height} pixels, another shape than its photo of {photo_width}x{photo_height}; {mend}"
    )


def same_shape(one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Is one the other, scaled? Sizes are whole pixels, so that small ones are off by up to one."""
    if abs(one[0] * other[1] / (one[1] * other[0]) - 1.0) <= MAX_MISMATCH:
        return True
    pairs = list(zip(one, other, strict=True))
    return max((small - 1) / full for small, full in pairs) <= min((small + 1) / full for small, full in pairs)
