"""PatchMatch stereo of one photo with its neighbours: the compiled kernels behind plain arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from room2dgs.geometry.camera import Camera
from room2dgs.kernels.builds import CPU, Build


@dataclass(frozen=True)
class Matching:
    """How planes are compared and searched.

    Attributes:
        radius, step: window of (2 radius / step + 1)^2 samples, pixels.
        sigma_grey: of the bilateral weight, grey levels of 255; sigma_px: likewise, pixels.
        variance_floor: added to both windows' variances in the NCC, grey levels^2: blank windows agree by chance.
        top_k: the cost of a plane is its mean over this many of the views that like it most.
        slope: steepest planes are looked at, as |gradient of inverse depth| x focal length / inverse depth.
        geometric_weight: cost of a pixel of forward-backward reprojection error.
    """

    radius: int = 4
    step: int = 2
    sigma_grey: float = 12.0
    sigma_px: float = 4.0
    variance_floor: float = 1.0
    top_k: int = 3
    slope: float = 3.0
    geometric_weight: float = 0.1


@dataclass(frozen=True)
class Packed:
    """A view ready for stereo.

    Attributes:
        photo: its grey photo, packed by `kernels`.
        camera: of the photo's size.
        kernels: the CPU's own, or block code's: they find the same planes.
    """

    photo: Any
    camera: Camera
    kernels: Build


def packed(grey: np.ndarray, camera: Camera, kernels: Build = CPU) -> Packed:
    """A view from its grey photo.

    Args:
        grey: (H, W) uint8, of the camera's size.
    """
    if grey.shape != (camera.height, camera.width):
        raise ValueError(f"the photo has shape {grey.shape}, its camera {camera.width} x {camera.height} pixels")
    return Packed(kernels.extension.StereoPhoto(np.ascontiguousarray(grey, np.uint8)), camera, kernels)


class PackedWhenAsked(Sequence[Packed]):
    """Views that are packed when they are asked for: packed ones take four times their photos' memory.

    Args:
        photos: grey, (H, W) uint8, of their cameras' sizes.
        at_once: views that stay packed; a photo and its neighbours are asked for next to each other.
    """

    def __init__(
        self, photos: Sequence[np.ndarray], cameras: Sequence[Camera], kernels: Build = CPU, at_once: int = 32
    ) -> None:
        self._count = len(photos)
        self._packed = lru_cache(at_once)(lambda index: packed(photos[index], cameras[index], kernels))

    def __getitem__(self, index: int) -> Packed:  # type: ignore[override]  # no slices
        return self._packed(range(self._count)[index])

    def __len__(self) -> int:
        return self._count


def warp(camera: Camera, other: Camera) -> np.ndarray:
    """(3, 4) float64 [M | t]: pixel x with inverse depth w is seen by `other` at M (x, 1) + t w, homogeneous.

    Pixels count centres at integers here: that is what arrays are indexed by.
    """
    shift = np.array([[1.0, 0.0, -0.5], [0.0, 1.0, -0.5], [0.0, 0.0, 1.0]])
    relative = other.cam_from_world @ camera.world_from_cam
    K, other_K = shift @ camera.K, shift @ other.K
    return np.ascontiguousarray(
        np.concatenate([other_K @ relative[:3, :3] @ np.linalg.inv(K), other_K @ relative[:3, 3:]], axis=1)
    )


class Search:
    """The planes of one photo.

    Args:
        view: the photo.
        others: its neighbours.
        inverse_depths: (h, w) float32 of each neighbour, 1/m, 0 = unknown, for geometric consistency; None: without.
        depth_range: nearest and farthest depth that is looked at, metres.
        seed: of random draws; the same seed gives the same bits on any number of threads.
    """

    def __init__(
        self,
        view: Packed,
        others: Sequence[Packed],
        settings: Matching,
        depth_range: tuple[float, float],
        seed: int,
        inverse_depths: Sequence[np.ndarray] | None = None,
    ) -> None:
        near, far = depth_range
        focal = 0.5 * (view.camera.K[0, 0] + view.camera.K[1, 1])
        self._size = (view.camera.height, view.camera.width)
        self._geometric = settings.geometric_weight if inverse_depths is not None else 0.0
        self._kernels = view.kernels
        self._match = view.kernels.extension.PatchMatch(
            view.photo,
            settings.radius,
            settings.step,
            settings.sigma_grey,
            settings.sigma_px,
            settings.variance_floor,
            min(settings.top_k, len(others)),
            1 / far,
            1 / near,
            settings.slope / focal,
            1 / focal,
            (seed * 2654435761 + 12345) % 2**32,
        )
        for index, other in enumerate(others):
            depth = None if inverse_depths is None else np.ascontiguousarray(inverse_depths[index], np.float32)
            there, back = warp(view.camera, other.camera), warp(other.camera, view.camera)
            self._match.add_view(other.photo, there, back, depth)

    def run(
        self,
        planes: np.ndarray,
        iterations: int,
        *,
        perturbation: float = 1.0,
        random_depths: int = 0,
        hints: np.ndarray | None = None,
        first_draw: int = 0,
        thrifty: bool = False,
    ) -> np.ndarray:
        """Propagation and random search from some planes.

        Args:
            planes: (3, H, W) float32 to start from; w = 0: a random one.
            iterations: sweeps over both colours of the checkerboard.
            perturbation: size of the random changes, halved at each iteration.
            random_depths: iterations in which any depth is tried too.
            hints: (3, H, W) float32, a plane to try at each pixel, w = 0 = none.
            first_draw: tells the draws of several runs with one seed apart.
            thrifty: after the first iteration a plane is shown only to the views that its cost is the mean over, not
                to all: faster, for planes that are nearly right.

        Returns:
            (3, H, W) float32.
        """
        self._match.set_planes(np.ascontiguousarray(planes, np.float32))
        if hints is not None:
            self._match.set_hints(np.ascontiguousarray(hints, np.float32))
        queue = self._kernels.queue(None)
        self._match.run(iterations, perturbation, random_depths, self._geometric, first_draw, thrifty, queue)
        found = np.empty((3, *self._size), np.float32)
        self._match.planes(found)
        return found

    def costs(self, planes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(H, W) photometric costs of planes, 0 (alike) to 2, and (H, W) variances of the windows, grey levels^2."""
        self._match.set_planes(np.ascontiguousarray(planes, np.float32))
        cost, variance = np.empty(self._size, np.float32), np.empty(self._size, np.float32)
        self._match.costs(0.0, cost, variance, self._kernels.queue(None))
        return cost, variance
