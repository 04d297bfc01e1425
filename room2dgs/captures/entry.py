"""A shot that was chosen, with its pose and lens, before it becomes a frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from room2dgs.captures.capture import Shot
from room2dgs.captures.lens import Lens
from room2dgs.captures.photos import Photo


@dataclass(frozen=True)
class Entry:
    """A shot with its pose, camera-to-world in metres, and its lens at the photo's size.

    Attributes:
        index: place in the capture's order.
        photo, mask: as they are read, turned where that has to be; None: the shot's photo file; no mask.
        transparent: the photo has an alpha.
    """

    index: int
    shot: Shot
    world_from_cam: np.ndarray
    lens: Lens | None = None
    size: tuple[int, int] = (0, 0)
    photo: Photo | None = None
    mask: Photo | None = None
    transparent: bool = False

    @property
    def fitted_lens(self) -> Lens:
        """`lens`, once it is fitted to the photo (`room2dgs.captures.fitted`)."""
        assert self.lens is not None, f"{self.shot.path} has no lens"
        return self.lens
