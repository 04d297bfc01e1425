"""`room2dgs bench WHAT`: hands over to the benchmark."""

from __future__ import annotations

import importlib

from room2dgs.errors import InputError

# name -> where it is, and its line in the help
BENCHES = {
    "raster": ("room2dgs.bench.raster", "the rasterizer's time on this machine"),
    "prior": ("room2dgs.commands.bench_prior", "a prior's depth, normals and confidence where depth is known"),
    "lengths": (
        "room2dgs.commands.bench_lengths",
        "lengths in runs of made rooms, and their ±, against truth",
    ),
    "calibration": ("room2dgs.commands.bench_calibration", "expected errors of meshes against the true ones"),
    "plan": ("room2dgs.commands.bench_plan", "plans of runs of made rooms against truth: walls, openings"),
    "splats": ("room2dgs.commands.bench_splats", "pictures of splats against seconds, and another program's"),
    "table": ("room2dgs.commands.bench_table", "methods of the paper's Table I on captures with ground truth"),
    "suite": ("room2dgs.commands.bench_suite", "the same settings on several captures, as one table"),
}


def main(argv: list[str]) -> int:
    """Run the benchmark that the first argument names; the rest is its own."""
    if not argv or argv[0] in ("-h", "--help"):
        width = max(map(len, BENCHES))
        print("\n".join(f"room2dgs bench {name:<{width}} [--help]  {what}" for name, (_, what) in BENCHES.items()))
        return 0 if argv else 2
    if argv[0] not in BENCHES:
        raise InputError(f"bench {argv[0]} is not known; choose from {', '.join(BENCHES)}")
    return importlib.import_module(BENCHES[argv[0]][0]).main(argv[1:]) or 0
