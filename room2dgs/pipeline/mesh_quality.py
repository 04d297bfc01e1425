"""Tears, coverage, roughness of a mesh, by what a run and its capture know of the surface."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.runs.depth_coverage import SURE
from room2dgs.runs.folder import TRUST
from room2dgs.runs.trust import Trust, read_trust

if TYPE_CHECKING:
    from room2dgs.eval.mesh_quality import KnownView


def known_views(scene: Scene, config: Config, out: Path | None) -> list[KnownView]:
    """Training views, as many as judge a mesh, with the depth that a sensor measured or else the run trusts.

    Args:
        scene: with the poses of the mesh.
        out: the run's folder; None: the capture alone knows something.

    Raises:
        InputError: a photo's mask cannot be read.
    """
    from room2dgs.eval.mesh_quality import MOST_VIEWS, KnownView

    trust = {} if out is None else read_trust(out / TRUST)
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
