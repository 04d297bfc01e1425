"""Tears, coverage, roughness of the mesh of a run, or of other meshes in its place.

    python -m room2dgs.tools.mesh_quality RUN [MESH ...] [truth=MESH|none] [trust=RUN]

Without meshes the run's own one is judged. Its capture's truth says what is surface, if it has one. `trust` is a run of
the same capture whose trust.npz is taken.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path


def main(argv: list[str]) -> int:
    """Print the figures of each mesh, a column each."""
    from room2dgs.eval.mesh_quality import measure
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.pipeline.mesh_quality import known_views
    from room2dgs.pipeline.scene import scene_of_run
    from room2dgs.pipeline.truth import truth_in_scene
    from room2dgs.runs.folder import MESH, saved_settings

    given = dict(text.split("=", 1) for text in argv if "=" in text)
    run, *meshes = [text for text in argv if "=" not in text]
    config = saved_settings(Path(run))
    scene = scene_of_run(config)
    named = given.get("truth", str(scene.gt_mesh or "none"))
    truth = None if named == "none" else truth_in_scene(Path(named), scene).mesh
    views = known_views(scene, config, Path(given.get("trust", run)))
    found = {}
    for path in meshes or [str(Path(run) / MESH)]:
        found[path] = measure(read_in_scene(Path(path), scene.origin_m), views, truth).figures
        print(path)
        for key, value in found[path].items():
            print(f"  {key:20} {value if not isinstance(value, float) else f'{value:.4g}'}", flush=True)
    if "json" in given:
        Path(given["json"]).write_text(json.dumps(found, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
