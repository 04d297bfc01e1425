"""How well a run goes with one variant of the extension, from photos to a scored mesh, in a process of its own.

`python -m room2dgs.tools.numerics.variant_score LIBRARY KEY=VALUE ...` is `room2dgs run KEY=VALUE ...` with that
library.
"""

from __future__ import annotations

import json
import os
import runpy
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from room2dgs.errors import InputError
from room2dgs.tools.numerics.variant_run import use

KEPT = {"points.cache": "points", "prior.cache": "maps"}  # between the variants' runs of one capture


def scored(
    library: Path, env: Mapping[str, str], capture: str, settings: Sequence[str], out: Path, caches: Path
) -> dict[str, float]:
    """A run's scores by area, those of metrics.json.

    Args:
        env: of the process.
        out: the run's folder; one that is there is removed.
        caches: for what no kernel has a part in, sparse points and the networks' maps.

    Raises:
        InputError: the run fails.
    """
    shutil.rmtree(out, ignore_errors=True)
    kept = [f"{key}={caches / folder}" for key, folder in KEPT.items()]
    command = [sys.executable, "-m", "room2dgs.tools.numerics.variant_score", str(library)]
    command += [f"scene.path={capture}", f"out={out}", "report.enabled=false", *kept, *settings]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **env}, check=False)
    if done.returncode:
        raise InputError(f"{capture} with {library}: {(done.stderr or done.stdout)[-500:]}")
    found = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    if "protocols" not in found:
        raise InputError(f"{capture} has no ground truth, so that nothing can be scored; give scene.gt_mesh")
    return found["protocols"]["area"]


def main(argv: list[str]) -> None:
    """Run; ends the process."""
    use(Path(argv[0]))

    from room2dgs import _C

    assert Path(_C.__file__) == Path(argv[0])
    sys.argv = ["room2dgs", "run", *argv[1:]]
    runpy.run_module("room2dgs.cli", run_name="__main__")  # the command line, which nothing here may import


if __name__ == "__main__":
    main(sys.argv[1:])
