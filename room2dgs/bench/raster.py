"""`room2dgs bench raster`: how long rendering takes, and how far that is from what this machine can do.

Everything is measured in one run, so that times may be compared as ratios. The *bare loop* is the same
arithmetic on single tiles, each run over and over with its data in the cache: the machine's limit.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from rich.table import Table
from torch import Tensor

from room2dgs import _C, splat
from room2dgs.bench.raster_scene import box_surfels, inside_view
from room2dgs.bench.timing import best_seconds
from room2dgs.cores import available_cores
from room2dgs.losses.photometric import rgb_loss
from room2dgs.losses.surface import normal_consistency
from room2dgs.splat import Surfels

SIZES = ((320, 240), (640, 480))
COUNTS = (20_000, 100_000, 500_000)
TILE_STEP = 8  # the bare loop runs every n-th tile
FLOOR = 1 / 32  # as train.opacity_floor has it


class Case:
    """One image size and number of surfels, with incoming gradients as a training iteration has them."""

    def __init__(self, width: int, height: int, count: int, opacity_floor: float = FLOOR) -> None:
        self.width, self.height, self.count, self.opacity_floor = width, height, count, opacity_floor
        self.surfels = box_surfels(count)
        self.K, self.cam_from_world = inside_view(width, height)
        self.leaves = Surfels(*(x.clone().requires_grad_() for x in self.surfels))
        g = torch.Generator().manual_seed(1)
        self.g_color = torch.randn(height, width, 3, generator=g, dtype=torch.float32)
        self.g_depth = torch.randn(height, width, generator=g, dtype=torch.float32)

    def draw(self, render=splat.render, surfels: Surfels | None = None, **options):
        """Render for training: every output but the distortion."""
        options |= {"opacity_floor": self.opacity_floor}
        return render(surfels or self.surfels, self.K, self.cam_from_world, self.width, self.height, **options)

    def back(self, out) -> tuple[Tensor, ...]:
        """Gradients of all parameters."""
        flowing = [self.g_color, self.g_depth, self.g_color]
        return torch.autograd.grad([out.color, out.depth, out.normal], list(self.leaves), flowing)

    def seconds(self, repeats: int) -> tuple[float, float]:
        """Forward and backward."""
        forward = best_seconds(lambda: self.draw(with_distortion=False), repeats)
        backward = []
        for _ in range(repeats + 1):
            out = self.draw(surfels=self.leaves, with_distortion=False)
            start = time.perf_counter()
            self.back(out)
            backward.append(time.perf_counter() - start)
        return forward, min(backward[1:])

    def bare_seconds(self, repeats: int) -> dict[str, Any]:
        """Seconds a (pixel, surfel) pair of the bare loops on one thread, and the pairs of the whole image."""
        images = [torch.empty(self.height, self.width, *c) for c in ((3,), (), (), (), (3,))]
        frame: Any = _C.RasterFrame()  # its stubs know arrays alone
        bench: Any = _C.bench
        frame.forward(
            *self.surfels, self.cam_from_world.double(), self.K.double(), self.width, self.height, 0.05,
            self.opacity_floor, torch.zeros(3), *images, None,
        )  # fmt: skip
        forward, pairs = bench.bare_loop(frame, *images, None, TILE_STEP, repeats)
        backward, _ = bench.bare_loop(frame, *images, self.g_color, TILE_STEP, repeats)
        stages = [bench.time_stages(frame, *self.surfels, *images) for _ in range(repeats)]
        return {
            "forward": forward / pairs,
            "backward": backward / pairs,
            "pairs": bench.count_pairs(frame, *images),
            "visible": frame.visible,
            "tile_entries": frame.entries,
            "stages_ms": {k: 1e3 * min(s[k] for s in stages) for k in stages[0]},
        }


def measure(case: Case, threads: int, repeats: int) -> dict[str, Any]:
    """All figures of one case; times in milliseconds."""
    splat.set_threads(1)
    bare = case.bare_seconds(repeats)
    single = case.seconds(repeats)
    splat.set_threads(threads)
    several = case.seconds(repeats)
    row: dict[str, Any] = {
        "width": case.width, "height": case.height, "surfels": case.count,
        "visible": bare["visible"], "tile_entries": bare["tile_entries"],
        "pairs_per_pixel": bare["pairs"] / (case.width * case.height),
        "stages_of_forward_ms_1_thread": bare["stages_ms"],
    }  # fmt: skip
    for name, one, many in zip(("forward", "backward"), single, several, strict=True):
        row[f"{name}_ms"] = many * 1e3
        row[f"{name}_ms_1_thread"] = one * 1e3
        row[f"{name}_over_bare"] = one / (bare[name] * bare["pairs"])
        row[f"{name}_bare_ns_per_pair"] = bare[name] * 1e9
        row[f"{name}_thread_scaling"] = one / many
        row[f"{name}_pairs_per_second"] = bare["pairs"] / many
    return row


def profile_iteration(case: Case, repeats: int, surface: bool) -> dict[str, float]:
    """Milliseconds by stage of one whole training iteration, medians.

    Args:
        surface: with normal consistency, for which depth and normals have gradients; else by the photo alone.
    """
    g = torch.Generator().manual_seed(2)
    photo = torch.randint(0, 256, (case.height, case.width, 3), generator=g, dtype=torch.uint8)
    parameters = Surfels(*(x.clone().requires_grad_() for x in case.surfels))
    adam = torch.optim.Adam([{"params": [x], "lr": 1e-6} for x in parameters], eps=1e-15, fused=True)
    laps: dict[str, list[float]] = {}

    def lap(name: str, since: float) -> float:
        now = time.perf_counter()
        laps.setdefault(name, []).append(now - since)
        return now

    for _ in range(repeats + 1):
        t = time.perf_counter()
        target = photo.float() / 255
        t = lap("photo", t)
        out = case.draw(surfels=parameters, with_normal=surface, with_distortion=False)
        t = lap("raster forward", t)
        leaves = [x.detach().requires_grad_() for x in out]
        seen = type(out)(*leaves)
        rgb = rgb_loss(seen.color, target, 0.2)
        g_color = torch.autograd.grad(rgb, seen.color)[0]
        t = lap("L1 + D-SSIM, both ways", t)
        drawn, flowing = [out.color], [g_color]
        if surface:
            smooth = normal_consistency(seen, case.K, case.cam_from_world, "expected")
            drawn += [out.depth, out.normal]
            flowing += torch.autograd.grad(smooth, [seen.depth, seen.normal])
            t = lap("normal consistency, both ways", t)
        grads = torch.autograd.grad(drawn, list(parameters), flowing)
        t = lap("raster backward", t)
        for x, grad in zip(parameters, grads, strict=True):
            x.grad = grad
        adam.step()
        lap("Adam", t)
    return {name: 1e3 * sorted(times[1:])[repeats // 2] for name, times in laps.items()}


def main(argv: list[str] | None = None) -> int:
    """Measure, print a table, write JSON where --json says."""
    parser = argparse.ArgumentParser(prog="room2dgs bench raster", description=__doc__.splitlines()[0])
    parser.add_argument("--threads", type=int, default=available_cores(), help="threads of the main columns")
    parser.add_argument("--repeats", type=int, default=7, help="runs of each figure; the fastest counts")
    parser.add_argument("--quick", action="store_true", help="the smallest case alone")
    parser.add_argument(
        "--opacity-floor", type=float, default=FLOOR, help="hits fainter than this are skipped: train.opacity_floor"
    )
    parser.add_argument("--json", type=Path, help="also write the figures here")
    args = parser.parse_args(argv)
    from room2dgs.commit import commit
    from room2dgs.runs.metrics import machine

    torch.set_num_threads(1)  # as training has it: its kernels have the threads
    sizes, counts = (SIZES[:1], COUNTS[:1]) if args.quick else (SIZES, COUNTS)
    cases = [Case(width, height, count, args.opacity_floor) for width, height in sizes for count in counts]
    report: dict[str, Any] = {
        "machine": machine(), "commit": commit(), "isa": _C.isa(), "threads": args.threads, "repeats": args.repeats,
        "opacity_floor": args.opacity_floor,
        "cases": [measure(case, args.threads, args.repeats) for case in cases],
        "iterations": [],
    }  # fmt: skip
    for case in cases:
        photo, whole = (profile_iteration(case, args.repeats, surface) for surface in (False, True))
        report["iterations"].append(
            {
                "width": case.width, "height": case.height, "surfels": case.count, "stages_ms": whole,
                "photo_alone_ms": photo,
            }
        )  # fmt: skip
    _print(report)
    if args.json:
        args.json.parent.mkdir(parents=True, exist_ok=True)
        args.json.write_text(json.dumps(report, indent=1))
    return 0


def _print(report: dict[str, Any]) -> None:
    console = Console(width=150)
    floor = f"1/{1 / report['opacity_floor']:.0f}"
    console.print(
        f"machine {report['machine']}, commit {report['commit']}, kernels {report['isa']}, "
        f"{report['threads']} threads, fastest of {report['repeats']}, opacity floor {floor}"
    )
    table = Table(title="Rasterizer: milliseconds, and ratios within this run")
    for column in (
        "image", "surfels", "seen", "pairs/px", "forward", "backward",
        "fwd/bare", "bwd/bare", "fwd scaling", "bwd scaling", "fwd Mpairs/s", "bwd Mpairs/s",
    ):  # fmt: skip
        table.add_column(column, justify="right")
    for r in report["cases"]:
        table.add_row(
            f"{r['width']}x{r['height']}", str(r["surfels"]), str(r["visible"]), f"{r['pairs_per_pixel']:.0f}",
            f"{r['forward_ms']:.1f}", f"{r['backward_ms']:.1f}",
            f"{r['forward_over_bare']:.2f}", f"{r['backward_over_bare']:.2f}",
            f"{r['forward_thread_scaling']:.2f}", f"{r['backward_thread_scaling']:.2f}",
            f"{r['forward_pairs_per_second'] / 1e6:.0f}", f"{r['backward_pairs_per_second'] / 1e6:.0f}",
        )  # fmt: skip
    console.print(table)
    stages = Table(title="One training iteration: milliseconds by stage")
    names = list(report["iterations"][0]["stages_ms"])
    for column in ("image", "surfels", *names, "all", "by the photo alone"):
        stages.add_column(column, justify="right")
    for r in report["iterations"]:
        ms = r["stages_ms"]
        values = [f"{ms[n]:.1f}" for n in names]
        stages.add_row(
            f"{r['width']}x{r['height']}",
            str(r["surfels"]),
            *values,
            *(f"{sum(r[k].values()):.1f}" for k in ("stages_ms", "photo_alone_ms")),
        )
    console.print(stages)


if __name__ == "__main__":
    raise SystemExit(main())
