"""`room2dgs bench WHAT`: hands over to the benchmark."""

from __future__ import annotations

import importlib

from room2dgs.errors import InputError

# name -> where it is, and its line in the help
BENCHES = {
    "raster": ("room2dgs.bench.raster", "the rasterizer's time on this machine"),
    "numerics": ("room2dgs.commands.bench_numerics", "float32 against float64 on hard cases"),
    "gpu": ("room2dgs.commands.bench_gpu", "a backend against the reference and the CPU, and its time"),
    "prior": ("room2dgs.commands.bench_prior", "a prior's depth, normals and confidence where depth is known"),
    "memory": ("room2dgs.bench.memory", "the peak memory of training over the number of views"),
    "roofline": ("room2dgs.commands.bench_roofline", "what rendering on a GPU should take, on paper"),
    "stereo": ("room2dgs.commands.bench_stereo", "dense stereo where depth is known, and its time"),
    "calibration": (
        "room2dgs.commands.bench_calibration",
        "expected against true errors of every source of depth and normals",
    ),
    "suite": ("room2dgs.commands.bench_suite", "the same settings on several captures, as one table"),
    "tradeoff": ("room2dgs.commands.bench_tradeoff", "score against time for presets, or what each step brings"),
    "prior-error": ("room2dgs.commands.prior_error", "the mesh's score over the errors of the prior"),
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
