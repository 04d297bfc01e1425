"""Values that no run can work with, refused at the start with a sentence that names the key."""

from __future__ import annotations

import sys

from room2dgs.config import Config, PriorConfig, ResolutionConfig
from room2dgs.errors import InputError

CHOICES = {
    "scene.layout": ("scannet",),
    "scene.pixel_centres": ("integer", "half"),
    "points.source": ("sfm", "file"),
    "prior.depth.source": ("none", "files"),
    "prior.depth.meaning": ("metric_depth", "relative_depth", "relative_inverse_depth"),
    "prior.normal.source": ("none", "files"),
    "prior.normal.encoding": ("png8", "npy"),
    "prior.normal.axes": ("opencv", "opengl"),
    "prior.normal.facing": ("camera", "away"),
    "prior.normal.frame": ("camera", "world"),
    "seeds.decoder": ("explicit",),
    "mesh.depth": ("median", "expected"),
}
PROTOCOLS = ("area", "neuris", "manhattan")
# key -> (lowest, highest), both allowed
RANGES = {
    "scene.stride": (1, None),
    "scene.frames": (3, None),
    "scene.image_width": (16, 8192),
    "scene.test_every": (0, None),
    "points.max_features": (16, None),
    "points.peak_threshold": (0.0, 1.0),
    "points.overlap": (1, None),
    "points.min_track": (2, None),
    "points.max_error_px": (1e-3, None),
    "prior.depth.unit_m": (1e-9, 1e6),
    "prior.depth.max_residual": (1e-3, 10.0),
    "seeds.voxel_m": (1e-4, 10.0),
    "seeds.per_seed": (1, 64),
    "seeds.neighbours": (3, 256),
    "seeds.opacity": (0.005, 0.99),
    "seeds.max_scale_m": (1e-4, 10.0),
    "render.sh_degree": (0, 3),
    "render.sh_every": (1, None),
    "render.near_m": (1e-4, 1.0),
    "render.threads": (1, 1024),
    "loss.dssim": (0.0, 1.0),
    "loss.distortion.weight": (0.0, None),
    "loss.distortion.start": (0, None),
    "loss.normal_consistency.weight": (0.0, None),
    "loss.normal_consistency.start": (0, None),
    "loss.depth_prior.weight": (0.0, None),
    "loss.depth_prior.start": (0, None),
    "loss.normal_prior.weight": (0.0, None),
    "loss.normal_prior.start": (0, None),
    "train.iterations": (1, None),
    "train.log_every": (1, None),
    "train.test_every": (0, None),
    "train.checkpoint_every": (1, None),
    "train.keep_checkpoints": (1, None),
    "mesh.voxel_m": (1e-3, 1.0),
    "mesh.truncation_voxels": (1.0, 20.0),
    "mesh.max_depth_m": (0.1, None),
    "mesh.min_alpha": (0.0, 1.0),
    "mesh.max_angle_deg": (1.0, 90.0),
    "mesh.min_weight": (0.0, None),
    "mesh.min_triangles": (0, None),
    "mesh.keep_clusters": (1, None),
    "eval.threshold_m": (1e-4, None),
    "eval.samples": (100, None),
}


def check(config: Config) -> None:
    """Refuse impossible values.

    Raises:
        InputError: names the key, the value and what is allowed.
    """
    for key in ("out", "scene.path"):
        if not _get(config, key).strip():
            raise InputError(f"{key} is empty; give {key}=DIR")
    for key, allowed in CHOICES.items():
        if _get(config, key) not in allowed:
            raise InputError(f"{key}={_get(config, key)} is not known; choose from {', '.join(allowed)}")
    for key, (low, high) in RANGES.items():
        _check_range(key, _get(config, key), low, high)
    for name in vars(config.train.rates):
        _check_range(f"train.rates.{name}", getattr(config.train.rates, name), 0.0, 1e3)
    if config.train.rates.center > 0 and config.train.rates.center_final == 0:
        raise InputError("train.rates.center_final=0 cannot be reached exponentially; give a small positive rate")
    if config.points.source == "file" and not config.points.file:
        raise InputError("points.source=file needs points.file=PATH of a .ply with points")
    _check_priors(config.prior)
    _check_background(config.render.background)
    _check_protocols(config.eval.protocols)
    _check_resolutions(config.train.resolutions)


def _check_range(key: str, value: float | None, low: float, high: float | None) -> None:
    # Written so that NaN and infinity are refused too.
    if value is not None and not (low <= value <= (sys.float_info.max if high is None else high)):
        allowed = f"of {low} or more" if high is None else f"from {low} to {high}"
        raise InputError(f"{key}={value} is impossible; give a value {allowed}")


def _check_priors(prior: PriorConfig) -> None:
    for name in ("depth", "normal"):
        part = getattr(prior, name)
        if part.source == "files" and not part.path:
            raise InputError(f"prior.{name}.source=files needs prior.{name}.path=DIR with a map for each photo")
    if prior.depth.source != "none" and not prior.depth.align and prior.depth.meaning != "metric_depth":
        raise InputError(f"prior.depth.align=false needs metres, not {prior.depth.meaning}; align the maps")


def _check_background(background: list[float]) -> None:
    if len(background) != 3 or not all(0.0 <= channel <= 1.0 for channel in background):
        raise InputError(f"render.background={background} is impossible; give three numbers from 0 to 1")


def _check_protocols(names: list[str]) -> None:
    if not names:
        raise InputError(f"eval.protocols is empty; choose from {', '.join(PROTOCOLS)}")
    for name in names:
        if name not in PROTOCOLS:
            raise InputError(f"eval.protocols names {name!r}; choose from {', '.join(PROTOCOLS)}")


def _check_resolutions(levels: list[ResolutionConfig]) -> None:
    previous = 0
    for level in levels:
        if not (0.0 < level.fraction <= 1.0) or level.until <= previous:
            raise InputError(
                "train.resolutions needs fractions in (0, 1] and rising `until`; "
                f"fraction={level.fraction}, until={level.until} breaks that"
            )
        previous = level.until


def _get(config: Config, key: str):
    value = config
    for part in key.split("."):
        value = getattr(value, part)
    return value
