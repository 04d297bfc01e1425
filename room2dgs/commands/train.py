"""`room2dgs train`: sparse points and training, without the mesh."""

from __future__ import annotations

from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.pipeline.reconstruct import start_training
from room2dgs.runs.metrics import peak_memory_mb
from room2dgs.runs.outdated import outdated

USAGE = "room2dgs train DIR out=DIR [resume=true] [KEY=VALUE ...]"


def main(argv: list[str]) -> int:
    """Train on a capture, or go on with a run."""
    if asked_for_help(argv):
        return show(argv, USAGE, main.__doc__)
    run = start_training(argv)
    run.log(f"peak memory {peak_memory_mb() / 1000:.2f} GB")
    for line in outdated(run.path, "surfels"):
        run.log(line)
    run.log(f"next: room2dgs mesh out={run.path}")
    return 0
