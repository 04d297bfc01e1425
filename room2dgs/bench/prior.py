"""A prior measured on several scenes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from room2dgs.bench.prior_measure import SceneScore, measured
from room2dgs.bench.prior_prediction import open_networks
from room2dgs.bench.prior_views import scene_views
from room2dgs.config import PriorConfig, SceneConfig
from room2dgs.depth.network.maps import KINDS
from room2dgs.depth.network.shipped import NAME
from room2dgs.depth.simulated import simulated


def measured_scenes(scenes: Sequence[SceneConfig], prior: PriorConfig, log=print) -> list[SceneScore]:
    """The prior on every scene, its networks opened once.

    Raises:
        InputError: as `open_networks` and `measured`.
    """
    views = [scene_views(scene) for scene in scenes]  # a wrong folder is reported before the first is measured
    groups = open_networks(prior)
    return [measured(one, groups, prior, log) for one in views]


def in_words(prior: PriorConfig) -> str:
    """Where depth and normals come from."""
    parts = []
    for kind in KINDS:
        part = getattr(prior, kind)
        what = {"files": f"maps in {Path(part.path or '').name}", "none": "none"}
        parts.append(f"{kind}: {what.get(part.source, Path(part.model or NAME).name)}")
    return ", ".join(parts)


def is_simulated(prior: PriorConfig) -> bool:
    """Whether any of its maps were made from the ground truth."""
    parts = (prior.depth, prior.normal)
    return any(part.source == "files" and simulated(Path(part.path or "")) for part in parts)
