"""Each view's depth as it was last rendered: a neighbour's depth without a second rendering."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from room2dgs.captures.cache import Cache
from room2dgs.captures.packed_maps import pack_depth, unpack_depth
from room2dgs.splat.constants import MIN_COVERED_ALPHA

STEP = 2  # every other row and column is kept
FRACTION = "fraction"  # of the photos' size, in a checkpoint


class DepthCache:
    """Depths by view, at most an epoch old, detached, in 16 bits (`packed_maps`); of one image size.

    Inverse depth is what is given: it is linear in the image on a plane, so that interpolated between the kept pixels
    it is the plane's own.
    """

    def __init__(self, cache: Cache | None = None) -> None:
        self._cache = Cache() if cache is None else cache
        self._fraction = 1.0
        self._mine = object()  # tells its keys from those of others
        self._known: set[int] = set()

    def keep(self, index: int, fraction: float, depth: Tensor, alpha: Tensor) -> None:
        """Keep a rendering's depth; those of another image size are forgotten.

        Args:
            index: the view.
            fraction: the image's size.
            depth, alpha: (H, W) of the rendering.
        """
        if fraction != self._fraction:
            self._forget(fraction)
        kept, share = (values.detach()[::STEP, ::STEP].numpy() for values in (depth, alpha))
        self._put(index, pack_depth(np.where(share >= MIN_COVERED_ALPHA, kept, np.float32(0))))

    def has(self, index: int, fraction: float) -> bool:
        """Whether a depth of this view is kept at this size."""
        return fraction == self._fraction and index in self._known

    def get(self, index: int, fraction: float) -> Tensor | None:
        """(h, w) inverse depth of every `STEP`-th row and column, 1/m, 0 = none; None if none is kept."""
        if not self.has(index, fraction):
            return None
        depth = unpack_depth(self._codes(index))
        return torch.from_numpy(np.divide(1, depth, out=np.zeros_like(depth), where=depth > 0))

    def state(self) -> dict[str, Tensor]:
        """All that is kept, for a checkpoint: the 16 bits as int16; the images' size."""
        codes = {str(index): torch.from_numpy(self._codes(index).view(np.int16)) for index in sorted(self._known)}
        return _with_size(codes, self._fraction)

    def load(self, state: dict[str, Tensor]) -> None:
        """The way back from `state`."""
        fraction, codes_of = _opened(state)
        self._forget(fraction)
        for index, codes in codes_of.items():
            self._put(index, codes.numpy().view(np.uint16))

    def _codes(self, index: int) -> np.ndarray:
        kept = self._cache.get((self._mine, index))
        assert kept is not None, f"view {index} is known, so its depth is kept"
        return kept[0]

    def _put(self, index: int, codes: np.ndarray) -> None:
        self._cache.put((self._mine, index), (codes,))
        self._known.add(index)

    def _forget(self, fraction: float) -> None:
        for index in self._known:
            self._cache.discard((self._mine, index))
        self._fraction, self._known = fraction, set()


class DeviceDepthCache:
    """What `DepthCache` does, with depths of a device that stay there, as float32."""

    def __init__(self, device: torch.device) -> None:
        self._device, self._fraction = device, 1.0
        self._kept: dict[int, Tensor] = {}

    def keep(self, index: int, fraction: float, depth: Tensor, alpha: Tensor) -> None:
        """See `DepthCache`."""
        if fraction != self._fraction:
            self._fraction, self._kept = fraction, {}
        depth, alpha = (values.detach()[::STEP, ::STEP] for values in (depth, alpha))
        self._kept[index] = torch.where((alpha >= MIN_COVERED_ALPHA) & (depth > 0), depth.reciprocal(), 0.0)

    def has(self, index: int, fraction: float) -> bool:
        """See `DepthCache`."""
        return fraction == self._fraction and index in self._kept

    def get(self, index: int, fraction: float) -> Tensor | None:
        """See `DepthCache`."""
        return self._kept[index] if self.has(index, fraction) else None

    def state(self) -> dict[str, Tensor]:
        """See `DepthCache`."""
        kept = {str(index): self._kept[index] for index in sorted(self._kept)}
        return _with_size(kept, self._fraction)

    def load(self, state: dict[str, Tensor]) -> None:
        """See `DepthCache`."""
        self._fraction, kept = _opened(state)
        self._kept = {index: values.to(self._device) for index, values in kept.items()}


def _with_size(kept: dict[str, Tensor], fraction: float) -> dict[str, Tensor]:
    return {**kept, FRACTION: torch.tensor(fraction, dtype=torch.float64)} if kept else {}


def _opened(state: dict[str, Tensor]) -> tuple[float, dict[int, Tensor]]:
    """The images' size and depths by view; none of a checkpoint that is older than its size."""
    if FRACTION not in state:
        return 1.0, {}
    return float(state[FRACTION]), {int(name): values for name, values in state.items() if name != FRACTION}
