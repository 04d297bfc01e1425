"""Scalars for tensorboard."""

from __future__ import annotations

from pathlib import Path
from typing import Any


class Scalars:
    """Writes to out/tensorboard, or nowhere if not `enabled`."""

    def __init__(self, out: Path, enabled: bool, start: int) -> None:
        self._writer = None
        if enabled:
            from torch.utils.tensorboard import SummaryWriter  # slow to import

            # what a killed run wrote beyond its last checkpoint is drawn anew
            self._writer = SummaryWriter(str(Path(out) / "tensorboard"), purge_step=start if start else None)

    def add(self, values: dict[str, float], iteration: int) -> None:
        if self._writer:
            for name, value in values.items():
                self._writer.add_scalar(name, value, iteration)

    def add_pictures(self, pictures: dict[str, Any], iteration: int) -> None:
        """Pictures: (H, W, 3) uint8 by name."""
        if self._writer:
            for name, picture in pictures.items():
                self._writer.add_image(name, picture, iteration, dataformats="HWC")

    def close(self) -> None:
        if self._writer:
            self._writer.close()
