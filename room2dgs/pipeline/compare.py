"""Two runs beside each other: compare.html."""

from __future__ import annotations

from pathlib import Path

from room2dgs.errors import InputError
from room2dgs.logs import Log, to_terminal
from room2dgs.pipeline.room_facts import room_facts
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.scene import scene_of_run
from room2dgs.runs.folder import MESH, earlier_run, required
from room2dgs.runs.metrics import read_metrics


def compare_runs(first: Path, second: Path, to: Path, log: Log = to_terminal) -> Path:
    """Writes a page with both rooms, their scores, and the settings that differ.

    Args:
        first, second: folders of runs that have a mesh.
        to: the page's file.

    Returns:
        Its path.

    Raises:
        InputError: no run in a folder, no mesh or no capture of it, or a place that cannot be written.
    """
    from room2dgs.runs.page.compare import Side, write_comparison
    from room2dgs.runs.page.write import run_mesh

    def side(folder: Path) -> Side:
        config = earlier_run([f"out={folder}"])
        out = Path(config.out)
        required(out / MESH, "mesh")
        scene = scene_of_run(config)
        mesh = run_mesh(scene, config, out)
        if mesh is None:
            raise InputError(f"{out / MESH} has no faces; make it anew with `room2dgs mesh out={out}`")
        facts, _ = room_facts(scene, None, config, RunFolder(out, log))
        return Side(out.name, config, read_metrics(out), scene, mesh, facts)

    sides = side(first), side(second)
    try:
        to.parent.mkdir(parents=True, exist_ok=True)
        write_comparison(*sides, to)
    except OSError as error:
        raise InputError(f"{to} cannot be written ({error.strerror}); choose another to=FILE") from error
    log(f"comparison: {to} ({to.stat().st_size / 1e6:.1f} MB)")
    return to
