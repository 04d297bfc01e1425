"""Where conf/ is."""

from __future__ import annotations

from pathlib import Path


def conf_dir() -> Path:
    """The folder of the Hydra groups, in a checkout and in an installed wheel alike."""
    inside = Path(__file__).parents[1] / "conf"
    return inside if inside.is_dir() else Path(__file__).parents[2] / "conf"
