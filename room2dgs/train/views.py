"""Photos and cameras as the loop needs them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
import torch
from torch import Tensor

from room2dgs.captures.cache import Cache
from room2dgs.captures.image_files import whole_at
from room2dgs.captures.levelled import WHITE
from room2dgs.captures.packed_maps import pack
from room2dgs.captures.scene import Frame
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.camera_tensors import view_matrices
from room2dgs.train.device import DeviceCache
from room2dgs.train.prior_maps import compared_maps, prior_maps


class View(NamedTuple):
    """One photo at one size.

    Attributes:
        name: the frame's.
        image: (H, W, 3) uint8 RGB; shared with the cache, not to be written to.
        K: (3, 3) float32, pixels.
        cam_from_world: (4, 4) float32, metres.
        width, height: pixels.
        maps: the priors at the pixels that losses compare (`compared_maps`).
        gains: (3,) float32, from a rendering's red, green and blue to the photo's levels; None: 1.
        clips: whether it has gains, and white, which says no more than that something is at least so bright.
        mask: (H, W) bool, pixels of the photo that may be compared; None: all.
    """

    name: str
    image: Tensor
    K: Tensor
    cam_from_world: Tensor
    width: int
    height: int
    maps: ViewMaps[Tensor] = ViewMaps()
    gains: Tensor | None = None
    clips: bool = False
    mask: Tensor | None = None

    def target(self) -> Tensor:
        """(H, W, 3) float32 in 0..1."""
        return torch.div(self.image, 255)

    def exposed(self, color: Tensor) -> Tensor:
        """(H, W, 3) rendered colours as this photo was exposed, which clips what it has as white; differentiable."""
        if self.gains is None:
            return color
        color = color * self.gains
        return torch.where(self.image == WHITE, color.clamp(max=1.0), color) if self.clips else color


class Views:
    """Frames with their priors at any image size; photos are decoded and priors resized once.

    Args:
        priors: by frame name; frames may have none.
        cache: keeps photos and maps.
        on_device: keeps what is asked for there too; None: views are the CPU's.

    Attributes:
        frames, cache, on_device: as given.
        widest: photo's width, pixels.
    """

    def __init__(
        self,
        frames: Sequence[Frame],
        priors: Mapping[str, ViewMaps[np.ndarray]] | None = None,
        cache: Cache | None = None,
        on_device: DeviceCache | None = None,
    ) -> None:
        self.on_device = on_device
        self.cache = Cache() if cache is None else cache
        self.frames = [frame if frame.cache else replace(frame, cache=self.cache) for frame in frames]
        self.widest = max((frame.camera.width for frame in self.frames), default=1)
        self._priors = priors or {}
        self._mine = object()  # tells its keys from those of others

    def __len__(self) -> int:
        return len(self.frames)

    def at(self, index: int, fraction: float = 1.0, priors: bool = True) -> View:
        """The index-th view at `fraction` of the frame's size, intrinsics and priors scaled alike.

        Args:
            priors: false: nobody will ask for them, and unpacking costs time; a view that a device keeps has them.

        Raises:
            InputError: the photo cannot be decoded.
        """
        if self.on_device is None:
            return self._read(index, fraction, priors)
        return self.on_device.get_or((self._mine, index, fraction), lambda: self._read(index, fraction))

    def _read(self, index: int, fraction: float, priors: bool = True) -> View:
        frame = self.frames[index]
        camera = _resized(frame.camera, fraction)
        photo = self.photo(index, fraction)
        return View(
            frame.name,
            photo,
            *view_matrices(camera),
            camera.width,
            camera.height,
            self._maps(frame.name, camera) if priors else ViewMaps(),
            gains=None if frame.gains is None else torch.tensor(frame.gains, dtype=torch.float32),
            clips=frame.gains is not None and bool((photo == WHITE).any()),
            mask=self.mask(index, fraction),
        )

    def photo(self, index: int, fraction: float = 1.0) -> Tensor:
        """(H, W, 3) uint8 RGB of the index-th view; shared with the cache, not to be written to.

        Raises:
            InputError: it cannot be decoded.
        """
        frame = self.frames[index]
        if fraction == 1.0:
            return torch.from_numpy(frame.color())
        camera = _resized(frame.camera, fraction)
        size = (camera.width, camera.height)
        key = ("smaller photo", frame.place, size)
        made = self.cache.get_or(key, lambda: (cv2.resize(frame.color(), size, interpolation=cv2.INTER_AREA),))
        return torch.from_numpy(made[0])

    def mask(self, index: int, fraction: float = 1.0) -> Tensor | None:
        """(H, W) bool: pixels of the photo that may be used; None: all."""
        usable = self.frames[index].mask()
        if usable is None or fraction == 1.0:
            return None if usable is None else torch.from_numpy(usable)
        size = _resized(self.frames[index].camera, fraction).size
        return torch.from_numpy(whole_at(usable, size))

    def _maps(self, name: str, camera: Camera) -> ViewMaps[Tensor]:
        if name not in self._priors:
            return ViewMaps()
        key = (self._mine, name, camera.width, camera.height)
        packed = self.cache.get_or(key, lambda: pack(prior_maps(self._priors[name], camera.width, camera.height)))
        depth, depth_confidence, normal, normal_confidence = packed
        return compared_maps((depth, depth_confidence, normal, normal_confidence))


def _resized(camera: Camera, fraction: float) -> Camera:
    if fraction == 1.0:
        return camera
    return camera.resized(*(max(1, round(fraction * pixels)) for pixels in (camera.width, camera.height)))
