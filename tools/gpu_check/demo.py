"""The demo room, trained on the CPU and on another device, then meshed and scored: the settings are the same."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

Row = dict[str, Any]


def demo_row(run: Callable[[list[str]], int], folder: Path, room: Path, backend: str, settings: list[str]) -> Row:
    """One run in folder/BACKEND: its F-score, seconds of the training and of all, and peak memory of the GPU.

    Args:
        run: the command `room2dgs run`.
        backend: the rasterizer's name, which is `render.device` too.
    """
    out = folder / backend
    cuda = torch.cuda.is_available()
    if cuda:
        torch.cuda.reset_peak_memory_stats()
    start = time.perf_counter()
    run([f"scene.path={room}", f"out={out}", f"render.device={backend}", *settings])
    metrics = json.loads((out / "metrics.json").read_text())
    return {
        "backend": backend, "f_score_5cm": metrics.get("f_score_5cm"), "psnr": metrics.get("psnr_db"),
        "train_s": metrics["seconds"].get("train"), "all_s": time.perf_counter() - start,
        "gpu_mb": torch.cuda.max_memory_allocated() / 2**20 if cuda else None,
    }  # fmt: skip
