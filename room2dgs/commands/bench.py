"""`room2dgs bench raster`: hands over to the benchmark."""

from __future__ import annotations

import importlib

from room2dgs.errors import InputError

BENCHES = {"raster": "room2dgs.eval.bench_raster"}


def main(argv: list[str]) -> int:
    """Run the benchmark that the first argument names; the rest is its own."""
    if not argv or argv[0] in ("-h", "--help"):
        print("room2dgs bench raster [--help]\n\nMeasures the rasterizer on this machine.")
        return 0 if argv else 2
    if argv[0] not in BENCHES:
        raise InputError(f"bench {argv[0]} is not known; choose from {', '.join(BENCHES)}")
    return importlib.import_module(BENCHES[argv[0]]).main(argv[1:]) or 0
