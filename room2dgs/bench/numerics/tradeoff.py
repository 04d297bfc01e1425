"""What each approximation inside the rasterizer costs in error and gains in time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from room2dgs.bench.numerics.variant_run import COUNT, SIZE
from room2dgs.bench.numerics.variants import EXACT, SHIPPED, VARIANTS, Builder, Variant
from room2dgs.report.table import NOTHING, Table, table

REPEATS = 15
COVERED = 0.5  # alpha of the pixels whose depth is compared
Row = dict[str, Any]


def tradeoff(folder: Path, only: str = "", tell: Callable[[str], None] = lambda _: None) -> list[Row]:
    """A row for each variant: times over the shipped kernels' in turns, errors against a build without approximations.

    Args:
        folder: for builds; what is there is used again.
        only: variants whose "part: name" has one of these in it, apart by commas.
    """
    builder = Builder(folder)
    wanted = only.split(",")
    chosen = [v for v in VARIANTS if any(text in f"{v.part}: {v.name}" for text in wanted)]
    tell("shipped")
    shipped = builder.library(SHIPPED, folder / "shipped")
    before = _run(shipped, folder / "shipped.pt", "")
    tell("exact")
    _run(builder.library(EXACT, folder / "exact"), folder / "exact.pt", "")
    exact = torch.load(folder / "exact.pt", weights_only=True)
    rows = [_row(SHIPPED, (1.0, 1.0), folder / "shipped.pt", exact)]
    for index, variant in enumerate(chosen):
        tell(f"{variant.part}: {variant.name}")
        library = builder.library(variant, folder / f"variant_{index}") if variant.edits else shipped
        out = folder / f"variant_{index}.pt"
        here = _run(library, out, variant.isa)
        after = _run(shipped, folder / "shipped.pt", "")
        ratio = [here[way] / min(before[way], after[way]) for way in ("forward", "backward")]
        rows.append(_row(variant, (ratio[0], ratio[1]), out, exact))
        before = after
    return rows


def _run(library: Path, out: Path, isa: str) -> dict[str, float]:
    env = {**os.environ, "OMP_NUM_THREADS": "1"} | ({"ROOM2DGS_ISA": isa} if isa else {})
    command = [sys.executable, "-m", "room2dgs.bench.numerics.variant_run", library, out, str(REPEATS)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=env)
    return json.loads(done.stdout.splitlines()[-1])


def _row(variant: Variant, ratios: tuple[float, float], out: Path, exact: dict[str, list[Tensor]]) -> Row:
    found = torch.load(out, weights_only=True)
    color, alpha, depth = found["images"][:3]
    true_color, true_alpha, true_depth = exact["images"][:3]
    covered = (alpha > COVERED) & (true_alpha > COVERED)
    relative = ((depth - true_depth).abs() / true_depth)[covered]
    gradients = [
        float((a.double() - b.double()).norm() / b.double().norm())
        for a, b in zip(found["gradients"], exact["gradients"], strict=True)
    ]
    return {
        "part": variant.part, "variant": variant.name, "timed": variant.timed,
        "forward": ratios[0], "backward": ratios[1],
        "color": float((color - true_color).double().square().mean().sqrt()),
        "depth": float(relative.double().square().mean().sqrt()), "depth_max": float(relative.max()),
        "gradient": max(gradients),
    }  # fmt: skip


def tradeoff_table(rows: list[Row]) -> Table:
    """Ratios of times, and errors."""
    return table(
        f"Speed against error: {COUNT} surfels at {SIZE[0]}x{SIZE[1]}, one thread",
        {
            "part": lambda r: r["part"] or NOTHING,
            "variant": lambda r: r["variant"],
            "forward": lambda r: f"{r['forward']:.2f}" if r["timed"] else NOTHING,
            "backward": lambda r: f"{r['backward']:.2f}" if r["timed"] else NOTHING,
            "colour, rms": lambda r: f"{r['color']:.1e}",
            "depth, rms": lambda r: f"{r['depth']:.1e}",
            "depth, worst": lambda r: f"{r['depth_max']:.1e}",
            "gradient": lambda r: f"{r['gradient']:.1e}",
        },
        rows,
    )
