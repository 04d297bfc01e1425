"""The neighbour that a view is compared with in an iteration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs.captures.cache import Arrays
from room2dgs.config import Config
from room2dgs.geometry.view_selection import neighbours_by_pose
from room2dgs.train.depth_cache import DepthCache, DeviceDepthCache
from room2dgs.train.grey import GreyPhoto, grey_photo
from room2dgs.train.schedule import image_fraction, multiview_acts
from room2dgs.train.views import View, Views

DRAW = 0x6E62  # tells these draws from others of the same iteration


class Pair(NamedTuple):
    """What the multi-view terms need beside the view that is rendered.

    Attributes:
        photo: the view's own.
        neighbour: another view, of which nobody asks for priors.
        neighbour_photo: its photo.
        inverse_depth: (h, w) of the neighbour, as `DepthCache` has it.
        seed: of the iteration's draw of pixels.
    """

    photo: GreyPhoto
    neighbour: View
    neighbour_photo: GreyPhoto
    inverse_depth: Tensor
    seed: int


class NeighbourViews:
    """Draws neighbours and keeps what is compared of them: grey photos and depths.

    A draw depends on (train.seed, iteration) and on the kept depths, which are part of a checkpoint.

    Attributes:
        views: the training views.
    """

    def __init__(self, views: Views, config: Config) -> None:
        self.views = views
        self._config = config
        self._depths = DeviceDepthCache(views.on_device.device) if views.on_device else DepthCache(views.cache)
        self._mine = object()  # tells its keys from those of others
        self._lists: list[np.ndarray] | None = None

    def pair(self, iteration: int, index: int) -> Pair | None:
        """A pair of the view `index` with one of its neighbours that were rendered at this size.

        None without one, and in iterations in which no multi-view term acts.
        """
        if not multiview_acts(iteration, self._config):
            return None
        fraction = self._fraction_of(iteration)
        kept = [int(n) for n in self._neighbours(index) if self._depths.has(int(n), fraction)]
        if not kept:
            return None
        random = np.random.default_rng([self._config.train.seed % 2**63, iteration, DRAW])
        other = kept[random.integers(len(kept))]
        inverse_depth = self._depths.get(other, fraction)
        assert inverse_depth is not None  # the ones kept
        return Pair(
            self._photo(index, fraction),
            self.views.at(other, fraction, priors=False),
            self._photo(other, fraction),
            inverse_depth,
            int(random.integers(2**62)),
        )

    def keep(self, iteration: int, index: int, depth: Tensor, alpha: Tensor) -> None:
        """Keep the depth that view `index` was rendered with, if it will be asked for within an epoch."""
        epoch = len(self.views)
        if any(multiview_acts(soon, self._config) for soon in (iteration + 1, iteration + epoch)):
            self._depths.keep(index, self._fraction_of(iteration), depth, alpha)

    def state(self) -> dict[str, Tensor]:
        """The kept depths, for a checkpoint."""
        return self._depths.state()

    def load(self, state: dict[str, Tensor]) -> None:
        """The way back from `state`."""
        self._depths.load(state)

    def _neighbours(self, index: int) -> np.ndarray:
        if self._lists is None:
            cameras = [frame.camera for frame in self.views.frames]
            settings = self._config.loss.multiview
            self._lists = neighbours_by_pose(
                cameras,
                settings.neighbours,
                settings.min_baseline_m,
                settings.max_baseline_m,
                settings.max_angle_deg,
            )
        return self._lists[index]

    def _photo(self, index: int, fraction: float) -> GreyPhoto:
        if self.views.on_device is None:
            return self._made(index, fraction)
        return self.views.on_device.get_or((self._mine, index, fraction), lambda: self._made(index, fraction))

    def _made(self, index: int, fraction: float) -> GreyPhoto:
        settings = self._config.loss.multiview

        def made() -> Arrays:
            mask = self.views.mask(index, fraction)
            photo = grey_photo(self.views.photo(index, fraction), settings.patch, settings.min_std, mask)
            return tuple(values.numpy() for values in photo)

        # made again when the cache needs room: that is faster than a disk
        kept = self.views.cache.get_or((self._mine, index, fraction), made, write=False)
        return GreyPhoto(*map(torch.from_numpy, kept))

    def _fraction_of(self, iteration: int) -> float:
        return image_fraction(iteration, self._config.train, self.views.widest)
