"""Values that no run can work with, refused at the start with a sentence that names the key."""

from __future__ import annotations

import re
import sys

from room2dgs.config.schema import (
    NETWORK_SOURCES,
    Config,
    LossConfig,
    OnnxConfig,
    PriorConfig,
    ResolutionConfig,
    TermConfig,
)
from room2dgs.errors import InputError

CHOICES = {
    "scene.layout": ("scannet",),
    "scene.pixel_centres": ("integer", "half"),
    "points.source": ("sfm", "file"),
    "prior.provider": ("cpu", "cuda"),
    "prior.depth.source": ("none", "files", *NETWORK_SOURCES),
    "prior.depth.meaning": ("metric_depth", "relative_depth", "relative_inverse_depth"),
    "prior.normal.source": ("none", "files", *NETWORK_SOURCES),
    "prior.normal.encoding": ("png8", "npy"),
    "prior.normal.axes": ("opencv", "opengl", "rdf", "rub", "rdb", "ruf", "ldf", "lub", "ldb", "luf"),
    "prior.normal.facing": ("camera", "away"),
    "prior.normal.frame": ("camera", "world"),
    "seeds.init": ("sfm", "sfm+depth", "points"),
    "seeds.decoder": ("explicit", "shared"),
    "seeds.scale_activation": ("exp", "softplus"),
    "strategy.name": ("fixed", "seeds", "plain"),
    "mesh.depth": ("median", "expected"),
}
# of either network
ONNX_CHOICES = {
    "fit": ("stretch", "pad", "cover"),
    "layout": ("nchw", "nhwc"),
    "channels": ("rgb", "bgr"),
    "values": ("signed", "zero_to_one"),
}
ONNX_RANGES = {
    "height": (1, 8192),
    "width": (1, 8192),
    "multiple": (1, 256),
    "white": (1e-3, 65535.0),
    "error_scale": (1e-6, 1e3),
    "max_error": (1e-6, 1e6),
    "output_channel": (0, 255),
    "canonical_focal_px": (1.0, 1e5),
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
    "prior.threads": (1, 1024),
    "prior.depth.unit_m": (1e-9, 1e6),
    "prior.depth.max_residual": (1e-3, 10.0),
    "prior.depth.max_outlier_ratio": (0.0, 1.0),
    "seeds.voxel_m": (1e-4, 10.0),
    "seeds.depth_voxel_m": (1e-3, 10.0),
    "seeds.per_seed": (1, 64),
    "seeds.neighbours": (3, 256),
    "seeds.feature_size": (1, 256),
    "seeds.opacity": (0.005, 0.99),
    "seeds.max_scale_m": (1e-4, 10.0),
    "render.sh_degree": (0, 3),
    "render.sh_every": (1, None),
    "render.near_m": (1e-4, 1.0),
    "render.threads": (1, 1024),
    "loss.dssim": (0.0, 1.0),
    "loss.normal_reweighting.start": (0.0, None),
    "loss.normal_reweighting.first_deg": (0.1, 180.0),
    "loss.normal_reweighting.last_deg": (0.1, 180.0),
    "loss.multiview.neighbours": (1, None),
    "loss.multiview.max_angle_deg": (1.0, 90.0),
    "loss.multiview.min_baseline_m": (1e-3, 100.0),
    "loss.multiview.max_baseline_m": (1e-3, 100.0),
    "loss.multiview.samples": (16, None),
    "loss.multiview.patch": (3, 31),
    "loss.multiview.min_std": (1e-3, 0.5),
    "strategy.start": (0.0, None),
    "strategy.stop": (0.0, None),
    "strategy.every": (1, None),
    "strategy.grow_gradient": (0.0, None),
    "strategy.min_visits": (1, None),
    "strategy.levels": (1, 8),
    "strategy.prune_opacity": (0.0, 1.0),
    "strategy.max_surfels": (1, None),
    "strategy.split_size": (0.0, None),
    "strategy.prune_size": (0.0, None),
    "strategy.reset_every": (0.0, None),
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
    if config.train.rates.network > 0 and config.train.rates.network_final == 0:
        raise InputError("train.rates.network_final=0 cannot be reached exponentially; give a small positive rate")
    if config.seeds.decoder == "shared" and config.render.sh_degree > 0:
        raise InputError(
            f"render.sh_degree={config.render.sh_degree} needs seeds.decoder=explicit; "
            "seeds.decoder=shared has colours of degree 0 alone"
        )
    if config.points.source == "file" and not config.points.file:
        raise InputError("points.source=file needs points.file=PATH of a .ply with points")
    if config.strategy.name == "plain" and (config.seeds.per_seed, config.seeds.decoder) != (1, "explicit"):
        raise InputError(
            "strategy=plain is densification of single surfels; give seeds.per_seed=1 and seeds.decoder=explicit"
        )
    _check_priors(config.prior)
    _check_losses(config.loss)
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
        _check_onnx(f"prior.{name}.onnx", part.onnx)
        if part.source == "onnx" and not part.onnx.model:
            raise InputError(f"prior.{name}.onnx.model=FILE is not given; get {part.onnx.get}")
        if part.source == "room_prior" and not part.onnx.output:
            raise InputError(f"prior.{name}.source=room_prior lacks its settings; write prior/{name}=room_prior")
    if prior.normal.source in NETWORK_SOURCES and prior.normal.encoding != "npy":
        raise InputError(
            f"prior.normal.source={prior.normal.source} makes maps of numbers; give prior.normal.encoding=npy with it"
        )
    if prior.normal.source in NETWORK_SOURCES and prior.normal.onnx.flip and prior.normal.frame == "world":
        raise InputError(
            "prior.normal.onnx.flip=true needs normals in the camera's frame, not prior.normal.frame=world"
        )
    if prior.depth.source != "none" and not prior.depth.align and prior.depth.meaning != "metric_depth":
        raise InputError(f"prior.depth.align=false needs metres, not {prior.depth.meaning}; align the maps")


def _check_losses(loss: LossConfig) -> None:
    for name, term in vars(loss).items():
        if isinstance(term, TermConfig):
            for key in ("weight", "start", "end", "ramp"):
                _check_range(f"loss.{name}.{key}", getattr(term, key), 0.0, None)
    if loss.multiview.patch % 2 == 0:
        raise InputError(f"loss.multiview.patch={loss.multiview.patch} has no middle pixel; give an odd number")
    if loss.multiview.max_baseline_m <= loss.multiview.min_baseline_m:
        raise InputError(
            f"loss.multiview.max_baseline_m={loss.multiview.max_baseline_m} leaves no neighbour; "
            f"give more than min_baseline_m={loss.multiview.min_baseline_m}"
        )


def _check_onnx(name: str, onnx: OnnxConfig) -> None:
    for key, allowed in ONNX_CHOICES.items():
        if getattr(onnx, key) not in allowed:
            raise InputError(f"{name}.{key}={getattr(onnx, key)} is not known; choose from {', '.join(allowed)}")
    for key, (low, high) in ONNX_RANGES.items():
        _check_range(f"{name}.{key}", getattr(onnx, key), low, high)
    for key, low in (("mean", -1e6), ("std", 1e-6)):
        values = getattr(onnx, key)
        if len(values) != 3 or not all(low <= value <= 1e6 for value in values):
            wanted = "three positive numbers" if key == "std" else "three numbers"
            raise InputError(f"{name}.{key}={values} is impossible; give {wanted}, one for each channel")
    if onnx.sha256 is not None and not re.fullmatch("[0-9a-fA-F]{64}", onnx.sha256):
        raise InputError(f"{name}.sha256={onnx.sha256} is no SHA-256; give 64 hexadecimal digits or null")


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
