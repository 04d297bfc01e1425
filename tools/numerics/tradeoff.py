"""What each approximation inside the rasterizer costs in error and gains in time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from room2dgs.errors import InputError
from room2dgs.report.table import NOTHING, Table, table
from room2dgs.tools.numerics.variant_run import COUNT, SIZE
from room2dgs.tools.numerics.variant_score import scored
from room2dgs.tools.numerics.variants import EXACT, SHIPPED, VARIANTS, Builder, Variant

REPEATS = 15
COVERED = 0.5  # alpha of the pixels whose depth is compared
Row = dict[str, Any]
Scores = dict[str, tuple[float, float] | None]  # F at 5 and 2 cm by capture; None: the run failed


def tradeoff(
    folder: Path,
    only: str = "",
    tell: Callable[[str], None] = lambda _: None,
    captures: Sequence[str] = (),
    settings: Sequence[str] = (),
) -> list[Row]:
    """A row for each variant: times over the shipped kernels' in turns, errors against a build without approximations.

    Args:
        folder: for builds; what is there is used again.
        only: variants whose "part: name" has one of these in it, apart by commas.
        captures: folders that each variant makes a run of, to be scored.
        settings: of those runs.

    A variant whose run fails has None for that capture's scores; `tell` gets its last words.

    Raises:
        InputError: a variant cannot be built, or a run of the shipped kernels fails.
    """
    builder = Builder(folder)
    wanted = only.split(",")
    chosen = [v for v in VARIANTS if any(text in f"{v.part}: {v.name}" for text in wanted)]

    def scores(library: Path, isa: str) -> Scores:
        found: Scores = {}
        for capture in captures:
            name = Path(capture).name
            out, caches = folder / "runs" / name, folder / "caches" / name
            try:
                run = scored(library, _environment(isa), capture, settings, out, caches)
            except InputError as error:
                if library == shipped and not isa:  # the others would fail as well
                    raise
                tell(str(error))
                found[name] = None
            else:
                found[name] = run["f_score_5cm"], run["f_score_2cm"]
        return found

    tell("shipped")
    shipped = builder.library(SHIPPED, folder / "shipped")
    before = _run(shipped, folder / "shipped.pt", "")
    tell("exact")
    exact_build = builder.library(EXACT, folder / "exact")
    _run(exact_build, folder / "exact.pt", "")
    exact = torch.load(folder / "exact.pt", weights_only=True)
    rows = [_row(SHIPPED, (1.0, 1.0), folder / "shipped.pt", exact, scores(shipped, ""))]
    if captures:
        rows.append(_row(EXACT, None, folder / "exact.pt", exact, scores(exact_build, "")))
    for index, variant in enumerate(chosen):
        tell(f"{variant.part}: {variant.name}")
        library = builder.library(variant, folder / f"variant_{index}") if variant.edits else shipped
        out = folder / f"variant_{index}.pt"
        here = _run(library, out, variant.isa)
        after = _run(shipped, folder / "shipped.pt", "")
        ratio = [here[way] / min(before[way], after[way]) for way in ("forward", "backward")]
        ratios = (ratio[0], ratio[1]) if variant.timed else None
        rows.append(_row(variant, ratios, out, exact, scores(library, variant.isa)))
        before = after
    return rows


def _environment(isa: str) -> dict[str, str]:
    return {"OMP_NUM_THREADS": "1"} | ({"ROOM2DGS_ISA": isa} if isa else {})


def _run(library: Path, out: Path, isa: str) -> dict[str, float]:
    env = {**os.environ, **_environment(isa)}
    command = [sys.executable, "-m", "room2dgs.tools.numerics.variant_run", str(library), str(out), str(REPEATS)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=env)
    return json.loads(done.stdout.splitlines()[-1])


def _row(
    variant: Variant,
    ratios: tuple[float, float] | None,
    out: Path,
    exact: dict[str, list[Tensor]],
    scores: Scores,
) -> Row:
    """`ratios`: None where times mean nothing."""
    found = torch.load(out, weights_only=True)
    color, alpha, depth = found["images"][:3]
    true_color, true_alpha, true_depth = exact["images"][:3]
    covered = (alpha > COVERED) & (true_alpha > COVERED)
    relative = ((depth - true_depth).abs() / true_depth)[covered]
    gradients = [
        float((a.double() - b.double()).norm() / b.double().norm())
        for a, b in zip(found["gradients"], exact["gradients"], strict=True)
    ]
    forward, backward = ratios or (None, None)
    return {
        "part": variant.part, "variant": variant.name, "forward": forward, "backward": backward,
        "color": float((color - true_color).double().square().mean().sqrt()),
        "depth": float(relative.double().square().mean().sqrt()), "depth_max": float(relative.max()),
        "gradient": max(gradients), "scores": scores,
    }  # fmt: skip


def tradeoff_table(rows: list[Row]) -> Table:
    """Ratios of times, errors, and scores of captures."""

    def ratio(value: float | None) -> str:
        return NOTHING if value is None else f"{value:.2f}"

    def score(row: Row, name: str) -> str:
        found = row["scores"][name]
        return "failed" if found is None else "{:.3f} ({:.3f})".format(*found)

    columns: dict[str, Callable[[Row], str]] = {
        "part": lambda r: r["part"] or NOTHING,
        "variant": lambda r: r["variant"],
        "forward": lambda r: ratio(r["forward"]),
        "backward": lambda r: ratio(r["backward"]),
        "colour, rms": lambda r: f"{r['color']:.1e}",
        "depth, rms": lambda r: f"{r['depth']:.1e}",
        "depth, worst": lambda r: f"{r['depth_max']:.1e}",
        "gradient": lambda r: f"{r['gradient']:.1e}",
    }
    for name in rows[0]["scores"]:
        columns[f"F @ 5 cm (2 cm), {name}"] = partial(score, name=name)
    return table(f"Speed against error: {COUNT} surfels at {SIZE[0]}x{SIZE[1]}, one thread", columns, rows)
