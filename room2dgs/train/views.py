"""Photos and cameras as the loop needs them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs.captures.scene import Frame
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.geometry.camera_tensors import view_matrices
from room2dgs.train.prior_maps import prior_maps


class View(NamedTuple):
    """One photo at one size.

    Attributes:
        name: the frame's.
        image: (H, W, 3) uint8 RGB.
        K: (3, 3) float32, pixels.
        cam_from_world: (4, 4) float32, metres.
        width, height: pixels.
        maps: the priors as `prior_maps` gives them: depth without its own edges, all with confidences.
    """

    name: str
    image: Tensor
    K: Tensor
    cam_from_world: Tensor
    width: int
    height: int
    maps: ViewMaps[Tensor] = ViewMaps()

    def target(self) -> Tensor:
        """(H, W, 3) float32 in 0..1."""
        return torch.div(self.image, 255)


class Views:
    """Frames read once for each image size and kept as bytes; only the size in use is kept.

    Args:
        priors: by frame name; frames may have none.
    """

    def __init__(self, frames: Sequence[Frame], priors: Mapping[str, ViewMaps[np.ndarray]] | None = None) -> None:
        self.frames = frames
        self._priors = priors or {}
        self._fraction = 1.0
        self._kept: dict[int, View] = {}

    def __len__(self) -> int:
        return len(self.frames)

    def at(self, index: int, fraction: float = 1.0) -> View:
        """The index-th view at `fraction` of the frame's size.

        Raises:
            InputError: the photo cannot be decoded.
        """
        if fraction != self._fraction:
            self._fraction, self._kept = fraction, {}
        if index not in self._kept:
            frame = self.frames[index]
            self._kept[index] = load_view(frame, fraction, self._priors.get(frame.name))
        return self._kept[index]


def load_view(frame: Frame, fraction: float, prior: ViewMaps[np.ndarray] | None = None) -> View:
    """Read one photo at `fraction` of the frame's size, intrinsics and priors scaled alike.

    Raises:
        InputError: the photo cannot be decoded.
    """
    camera = frame.camera
    if fraction != 1.0:
        size = [max(1, round(fraction * pixels)) for pixels in (camera.width, camera.height)]
        camera = camera.resized(*size)
    image = np.ascontiguousarray(replace(frame, camera=camera).color())
    return View(
        frame.name,
        torch.from_numpy(image),
        *view_matrices(camera),
        camera.width,
        camera.height,
        prior_maps(prior, camera.width, camera.height),
    )
