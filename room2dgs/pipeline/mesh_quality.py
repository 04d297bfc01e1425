"""Tears, coverage, roughness of a mesh, by what a run and its capture know of the surface."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.logs import Log
from room2dgs.runs.depth_coverage import SURE
from room2dgs.runs.folder import EVAL, QUALITY
from room2dgs.runs.mirrors import trusted_depths
from room2dgs.runs.trust import Trust

if TYPE_CHECKING:
    import trimesh

    from room2dgs.eval.mesh_quality import KnownView


def quality_figures(
    mesh: trimesh.Trimesh, scene: Scene, config: Config, run: Path, truth: trimesh.Trimesh | None, log: Log
) -> dict[str, Any]:
    """For metrics.json: "mesh_quality", with pictures in the folder `eval`; empty without a training view.

    Args:
        mesh, truth: in the scene's frame; None: no truth is known there.
        run: folder of the run, or that of the scores of a mesh that no run made.

    Raises:
        InputError: a photo cannot be read.
    """
    from room2dgs.eval.mesh_quality import MOST_VIEWS, measure
    from room2dgs.eval.quality_pictures import write_quality_pictures
    from room2dgs.eval.quality_text import sentence

    found = measure(mesh, known_views(scene, config, run), truth)
    write_quality_pictures(run / EVAL / QUALITY, found, evenly_spaced(scene.train, MOST_VIEWS))
    log(sentence(found.figures))
    return {"mesh_quality": found.figures}


def known_views(scene: Scene, config: Config, out: Path) -> list[KnownView]:
    """Training views, as many as judge a mesh, with the depth that a sensor measured or else the run trusts.

    Args:
        scene: with the poses of the mesh.
        out: the run's folder.

    Raises:
        InputError: a photo's mask cannot be read.
    """
    from room2dgs.eval.mesh_quality import MOST_VIEWS, KnownView

    trust = trusted_depths(out, scene)
    return [
        KnownView(frame.camera, tuple(_depths(frame, config, trust.get(frame.name))), frame.mask())
        for frame in evenly_spaced(scene.train, MOST_VIEWS)
    ]


def _depths(frame: Frame, config: Config, trust: Trust | None) -> Iterator[np.ndarray]:
    """Of the sensor, and where it has none the run's."""
    from room2dgs.depth.sensor.maps import sensor_depth

    if frame.depth_path is not None:
        with suppress(InputError):  # one damaged map: the run did without it, too
            yield sensor_depth(frame, config.prior.depth)
    if trust is not None:
        yield trust.sure_depth(SURE)
