"""Who owns the buffers that a view's backward pass needs, and for how long.

An operator passes tensors and nothing else, so the owner is a tensor: the operator's last output, `state`, a tiny
one whose memory carries the frame in a table here. While any tensor shares that memory the frame is kept; then it
goes back to the shelf for the next view. A copy of `state` is another piece of memory and finds nothing: the backward
pass then renders again, to the same bits.
"""

from __future__ import annotations

import weakref
from collections import defaultdict
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

SHELF = 4  # of a kind; fresh memory would cost page faults at every iteration


class Kind(NamedTuple):
    """Frames that can stand in for one another.

    Attributes:
        make: the extension's class.
        device: whose memory it holds.
    """

    make: Any
    device: torch.device


_shelves: dict[Kind, list[Any]] = defaultdict(list)
_kept: dict[int, tuple[Any, int]] = {}


def acquire(kind: Kind) -> Any:
    """A frame to render into, used or new."""
    try:  # without asking first: another thread may pop the last one
        return _shelves[kind].pop()
    except IndexError:
        return kind.make()


def release(kind: Kind, frame: Any) -> None:
    """Back to the shelf; its contents are done with."""
    if len(_shelves[kind]) < SHELF:
        _shelves[kind].append(frame)


def keep(kind: Kind, frame: Any, view: int) -> Tensor:
    """Keep a rendered frame for as long as the tensor returned lives.

    Args:
        view: the number that the frame's `forward` gave.

    Returns:
        (2,) int64 on the CPU: surfels seen, and (surfel, tile) pairs.
    """
    memory = np.array([frame.visible, frame.entries], dtype=np.int64)
    key = memory.ctypes.data
    _kept[key] = (frame, view)
    weakref.finalize(memory, _release_key, kind, key).atexit = False  # runs before the memory can serve another
    return torch.from_numpy(memory)


def find(state: Tensor) -> tuple[Any, int] | None:
    """The frame and view that `keep` stored with this memory; None for a copy."""
    return _kept.get(state.data_ptr())


def num_kept() -> int:
    """How many frames wait for a backward pass."""
    return len(_kept)


def _release_key(kind: Kind, key: int) -> None:
    release(kind, _kept.pop(key)[0])
