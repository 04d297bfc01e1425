"""room2dgs: posed photos of a room to a metric triangle mesh, with 2D Gaussian surfels.

    run = room2dgs.reconstruct("room", "runs/room", experiment="quick")
    run.mesh.export("room.obj")

`reconstruct` makes a run, `open_run` opens an earlier one; both give a `Run`. What is wrong with the input is an
`InputError`, with a sentence that says what to do.
"""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from room2dgs.errors import InputError
    from room2dgs.pipeline.run import Run, open_run, reconstruct

# libgomp's workers spin after every parallel region of torch; on few cores that starves the
# rasterizer's own threads (up to tenfold). It reads this once, when torch is first imported.
if "torch" not in sys.modules:
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

__version__ = "0.1.0"
__all__ = ["InputError", "Run", "__version__", "open_run", "reconstruct"]


def __getattr__(name: str) -> Any:
    """The public names, imported when they are first used: `import room2dgs` stays quick."""
    if name == "InputError":
        from room2dgs.errors import InputError

        return InputError
    if name in ("Run", "open_run", "reconstruct"):
        from room2dgs.pipeline import run

        return getattr(run, name)
    raise AttributeError(f"module 'room2dgs' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
