"""The mirrors of a run's room on its page: each in the photo that shows it best."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.mirrors.mirror import Mirror
from room2dgs.report.page import Figure

MOST, WIDTH, ASKED = 4, 480, 160  # mirrors that are drawn; pixels of each photo, and of those that are asked
LINE, TINT = (1.0, 0.25, 0.1), 0.35


def mirror_figures(mirrors: Sequence[Mirror], frames: Sequence[Frame], unit: str) -> list[Figure]:
    """None without mirrors.

    Args:
        mirrors: scene's frame.

    Raises:
        InputError: a photo cannot be decoded.
    """
    if not mirrors or not frames:
        return []
    photos = [mirror_photo(mirror, frames) for mirror in mirrors[:MOST]]
    height = min(len(photo) for photo in photos)
    sizes = ", ".join(f"{width:.1f} × {height:.1f} {unit}" for width, height in (one.size_m for one in mirrors))
    caption = (
        f"Mirrors: {sizes}. What they show is the room once more: the glass takes its place in mesh and plan "
        "(mesh.glass=keep leaves it there)"
    )
    return [Figure(caption, np.concatenate([photo[:height] for photo in photos], axis=1))]


def mirror_photo(mirror: Mirror, frames: Sequence[Frame]) -> np.ndarray:
    """(H, W, 3) 0..1: the photo that most of whose pixels lie in the mirror, with these tinted and outlined."""
    shares = [(mirror.glass(frame.camera.resized_to_width(ASKED)) > 0).mean() for frame in frames]
    frame = frames[int(np.argmax(shares))]
    camera = frame.camera.resized_to_width(WIDTH)
    picture = cv2.resize(frame.color(), camera.size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    seen = mirror.glass(camera) > 0
    picture[seen] += TINT * (np.array(LINE, np.float32) - picture[seen])
    edges, _ = cv2.findContours(seen.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, edges, -1, LINE, 2)
    return picture
