"""Typed configuration: one dataclass for each Hydra group; the values live in conf/.

`load_config(overrides)` composes conf/config.yaml with the overrides, checks every type, refuses
unknown keys and impossible values, and returns a plain `Config`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from hydra import compose, initialize_config_dir
from hydra.errors import HydraException
from omegaconf import MISSING, DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from room2dgs.config_keys import Key, leaf_keys
from room2dgs.config_overrides import checked_overrides, group_choices, override_keys
from room2dgs.errors import InputError


@dataclass
class SceneConfig:
    """Which frames of which capture, at which size."""

    path: str = MISSING  # the capture's folder
    layout: str = MISSING  # scannet
    frames: int | None = MISSING  # use this many, evenly spaced (null: all)
    stride: int = MISSING  # use every n-th frame on disk
    image_width: int | None = MISSING  # resize down to this width, keeping the aspect (null: as on disk)
    pixel_centres: str = MISSING  # integer (ScanNet, OpenCV) | half: what cx, cy on disk count
    test_every: int = MISSING  # every n-th used frame is held out (0: none)
    gt_mesh: str | None = MISSING  # null: gt_mesh.ply in the capture's folder, if there


@dataclass
class PointsConfig:
    """Sparse points from SfM with the known poses, or from a file."""

    source: str = MISSING  # sfm | file
    file: str | None = MISSING  # point file (.ply) for source=file
    max_features: int = MISSING  # SIFT features an image
    peak_threshold: float = MISSING  # weakest contrast of a feature; lower finds more on plain walls
    overlap: int = MISSING  # views a frame is matched with: half its successors, half chosen by pose
    min_track: int = MISSING  # drop points seen in fewer views
    max_error_px: float = MISSING  # drop points with a larger mean reprojection error


@dataclass
class DepthPriorConfig:
    """Depth maps of the photos, from a network or a sensor."""

    source: str = MISSING  # none | files
    path: str | None = MISSING  # folder of <photo's name>.png (16-bit) or .npy
    unit_m: float | None = MISSING  # metres of one stored unit (null: 0.001 for PNG, 1 for .npy)
    meaning: str = MISSING  # metric_depth | relative_depth | relative_inverse_depth
    align: bool = MISSING  # robust scale and shift of each map to the sparse points
    max_residual: float = MISSING  # maps with a larger median relative residual are left out


@dataclass
class NormalPriorConfig:
    """Normal maps of the photos; what their numbers mean must be said."""

    source: str = MISSING  # none | files
    path: str | None = MISSING  # folder of <photo's name>.png or .npy
    encoding: str = MISSING  # png8 (n = rgb / 127.5 - 1) | npy
    axes: str = MISSING  # opencv (x right, y down, z forward) | opengl (x right, y up, z back)
    facing: str = MISSING  # camera | away: the side that normals point to
    frame: str = MISSING  # camera | world
    check: bool = MISSING  # stop if another convention fits clearly better


@dataclass
class PriorConfig:
    """Maps that tell depth and normals of each photo beforehand."""

    depth: DepthPriorConfig = field(default_factory=DepthPriorConfig)
    normal: NormalPriorConfig = field(default_factory=NormalPriorConfig)


@dataclass
class SeedsConfig:
    """Seeds and the surfels they spawn (eq. 8-9)."""

    voxel_m: float = MISSING  # delta
    per_seed: int = MISSING  # k surfels a seed
    neighbours: int = MISSING  # points for the local normal and scale
    opacity: float = MISSING  # initial opacity of every surfel
    max_scale_m: float = MISSING  # upper bound of the initial scale
    decoder: str = MISSING  # explicit


@dataclass
class RenderConfig:
    """What a rendering is."""

    sh_degree: int = MISSING  # 0..3
    sh_every: int = MISSING  # iterations between two raises of the active degree
    near_m: float = MISSING  # centres and hits nearer than this are not drawn
    background: list[float] = MISSING  # RGB in 0..1
    threads: int | None = MISSING  # null: all cores that this process may use


@dataclass
class TermConfig:
    """A loss term's weight and the iterations in which it acts."""

    enabled: bool = MISSING
    weight: float = MISSING
    start: int = MISSING  # first iteration


@dataclass
class LossConfig:
    """Loss terms; each has one toggle."""

    dssim: float = MISSING  # L_rgb = (1 - dssim) L1 + dssim D-SSIM
    distortion: TermConfig = field(default_factory=TermConfig)
    normal_consistency: TermConfig = field(default_factory=TermConfig)
    depth_prior: TermConfig = field(default_factory=TermConfig)  # acts on views that have a depth prior
    normal_prior: TermConfig = field(default_factory=TermConfig)  # acts on views that have a normal prior


@dataclass
class RatesConfig:
    """Adam's learning rates; `center` in metres for a scene of 1 m extent, as 2DGS has it."""

    center: float = MISSING
    center_final: float = MISSING  # reached exponentially at the last iteration
    rotation: float = MISSING
    scale: float = MISSING
    opacity: float = MISSING
    color: float = MISSING  # SH degree 0; the higher degrees learn at a twentieth


@dataclass
class ResolutionConfig:
    """Image size during training: `fraction` of the full size until iteration `until`."""

    fraction: float = MISSING
    until: int = MISSING


@dataclass
class TrainConfig:
    """The optimisation."""

    iterations: int = MISSING
    seed: int = MISSING
    rates: RatesConfig = field(default_factory=RatesConfig)
    resolutions: list[ResolutionConfig] = MISSING  # coarse to fine; after the last: full size
    log_every: int = MISSING  # iterations between two log lines
    test_every: int = MISSING  # iterations between two looks at the held-out views
    checkpoint_every: int = MISSING
    keep_checkpoints: int = MISSING
    tensorboard: bool = MISSING


@dataclass
class MeshConfig:
    """Rendered depth to mesh."""

    voxel_m: float = MISSING
    truncation_voxels: float = MISSING
    depth: str = MISSING  # median | expected
    max_depth_m: float = MISSING
    min_alpha: float = MISSING  # pixels less covered are not fused
    max_angle_deg: float = MISSING  # between surface normal and view ray; steeper pixels are not fused
    min_weight: float = MISSING  # voxels observed less are not meshed
    min_triangles: int = MISSING  # smaller connected pieces are dropped
    keep_clusters: int = MISSING  # at most this many connected pieces


@dataclass
class EvalConfig:
    """Scores against a ground truth."""

    protocols: list[str] = MISSING  # area | neuris | manhattan
    gt: str | None = MISSING  # ground-truth mesh (null: the scene's)
    pred: str | None = MISSING  # mesh to score (null: the run's)
    threshold_m: float = MISSING
    samples: int = MISSING  # area protocol: points a mesh
    seed: int = MISSING
    image_metrics: bool = MISSING


@dataclass
class Config:
    """The whole configuration of a run."""

    out: str = MISSING  # the run's folder
    resume: bool = MISSING  # go on from the last checkpoint in `out`
    scene: SceneConfig = field(default_factory=SceneConfig)
    points: PointsConfig = field(default_factory=PointsConfig)
    prior: PriorConfig = field(default_factory=PriorConfig)
    seeds: SeedsConfig = field(default_factory=SeedsConfig)
    render: RenderConfig = field(default_factory=RenderConfig)
    loss: LossConfig = field(default_factory=LossConfig)
    train: TrainConfig = field(default_factory=TrainConfig)
    mesh: MeshConfig = field(default_factory=MeshConfig)
    eval: EvalConfig = field(default_factory=EvalConfig)


def conf_dir() -> Path:
    """The folder of the Hydra groups, in a checkout and in an installed wheel alike."""
    inside = Path(__file__).parent / "conf"
    return inside if inside.is_dir() else Path(__file__).parent.parent / "conf"


def load_config(overrides: list[str] | tuple[str, ...] = (), earlier: Path | None = None) -> Config:
    """Compose, type-check and validate.

    Args:
        overrides: Hydra overrides, e.g. ["scene.path=room", "train.iterations=100"].
        earlier: config.yaml of an earlier run; it gives every setting that no override names.

    Raises:
        InputError: unknown key, wrong type, missing or impossible value; the sentence names the key.
    """
    from room2dgs.config_checks import check

    groups = group_choices(conf_dir())
    keys = leaf_keys(Config)
    overrides = checked_overrides(overrides, [key.name for key in keys], groups)
    try:
        with initialize_config_dir(str(conf_dir().resolve()), version_base="1.3"):
            composed = compose("config", overrides=overrides)
        raw = composed if earlier is None else _on_top_of(earlier, composed, override_keys(overrides))
        merged = OmegaConf.merge(OmegaConf.structured(Config), raw)
        for name in sorted(OmegaConf.missing_keys(merged)):
            raise InputError(f"{name} is not given; add {name}={'DIR' if name in ('out', 'scene.path') else '...'}")
        config: Any = OmegaConf.to_object(merged)
    except (HydraException, OmegaConfBaseException) as error:
        raise InputError(_one_sentence(error, keys, overrides)) from error
    check(config)
    return config


def dump_config(config: Config) -> str:
    """The configuration as YAML."""
    return OmegaConf.to_yaml(OmegaConf.structured(config))


def _on_top_of(earlier: Path, composed: DictConfig, chosen: list[str]) -> DictConfig:
    """The earlier run's settings with the chosen keys (settings or whole groups) taken from `composed`.

    Settings that did not exist yet when that run was made have their default.
    """
    if "experiment" in chosen:
        raise InputError("experiment= starts a new run; on an earlier one set single values instead")
    try:
        raw = OmegaConf.load(earlier)
        OmegaConf.merge(OmegaConf.structured(Config), raw)
    except (OSError, UnicodeDecodeError, yaml.YAMLError, OmegaConfBaseException) as error:
        raise InputError(f"{earlier} is not the configuration of a run; choose another out=DIR") from error
    raw = OmegaConf.merge(composed, raw)
    for key in chosen:
        OmegaConf.update(raw, key, OmegaConf.select(composed, key), merge=False)
    return raw


def _one_sentence(error: Exception, keys: list[Key], overrides: list[str]) -> str:
    """Hydra's and OmegaConf's many lines as one sentence that names the setting."""
    lines = [line.strip() for line in str(error.__cause__ or error).splitlines() if line.strip()]
    full_key = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("full_key:")), "")
    key = next((key for key in keys if key.name == full_key.partition("[")[0]), None)
    text = next((text for text in reversed(overrides) if key and text.startswith(key.name + "=")), None)
    if key and text:
        return f"{text} does not fit; {key.name} wants {key.wants}"
    return f"configuration: {lines[0]}" + (f" ({full_key})" if full_key else "")
