"""Where a run trains: on the CPU or on a GPU (`render.device`)."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch import Tensor

from room2dgs.kernels.builds import build_of

CPU = torch.device("cpu")


@contextmanager
def on_device(name: str) -> Iterator[torch.device]:
    """The device that `render.device` names, for as long as the block lasts.

    Raises:
        InputError: no GPU, or nothing that runs on it.
    """
    build_of(name)
    yield torch_device(name)


def torch_device(name: str) -> torch.device:
    """Where tensors are that `render.device` works on."""
    return torch.device("cuda", torch.cuda.current_device()) if name == "cuda" else CPU


def upload(values: Tensor, device: torch.device) -> Tensor:
    """The CPU's tensor on a device; neither waits for the other."""
    return values.pin_memory().to(device, non_blocking=True) if device.type == "cuda" else values.to(device)


def to_device(values: Any, device: torch.device) -> Any:
    """A named tuple's tensors on a device, in those inside it too; all else as it is."""
    if isinstance(values, Tensor):
        return upload(values, device)
    if isinstance(values, tuple) and hasattr(values, "_fields"):
        return type(values)(*(to_device(value, device) for value in values))
    return values


class DeviceCache:
    """What was moved to a device, by key, within a budget; used least recently, it goes and is moved again.

    Args:
        budget_mb: 10^6 bytes.
    """

    def __init__(self, device: torch.device, budget_mb: float) -> None:
        self.device = device
        self._budget, self._used = int(budget_mb * 1e6), 0
        self._kept: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()

    def get_or(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """What was moved under a key, else what `make` gives: a named tuple of the CPU's tensors."""
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key][0]
        found = to_device(make(), self.device)
        self._kept[key] = found, _bytes(found)
        self._used += self._kept[key][1]
        while self._used > self._budget and len(self._kept) > 1:
            self._used -= self._kept.popitem(last=False)[1][1]
        return found

    @property
    def in_memory(self) -> int:
        """Bytes."""
        return self._used


def _bytes(values: Any) -> int:
    if isinstance(values, Tensor):
        return values.numel() * values.element_size()
    return sum(map(_bytes, values)) if isinstance(values, tuple) else 0
