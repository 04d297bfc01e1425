"""Typed configuration: one dataclass for each Hydra group; the values live in conf/."""

from __future__ import annotations

from dataclasses import dataclass, field

from omegaconf import MISSING


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
    cache: str | None = MISSING  # folder that keeps triangulated points (null: points in the run's folder)
    max_features: int = MISSING  # SIFT features an image
    peak_threshold: float = MISSING  # weakest contrast of a feature; lower finds more on plain walls
    overlap: int = MISSING  # views a frame is matched with: half its successors, half chosen by pose
    min_track: int = MISSING  # drop points seen in fewer views
    max_error_px: float = MISSING  # drop points with a larger mean reprojection error


NETWORK_SOURCES = ("onnx", "room_prior")  # of priors: a network makes the maps


@dataclass
class OnnxConfig:
    """A depth or normal network in ONNX: what goes in and what comes out, as its maker documents it."""

    model: str | None = MISSING  # the .onnx file (null: with source=room_prior the one that comes with room2dgs)
    get: str = MISSING  # where that file comes from
    sha256: str | None = MISSING  # of that file (null: not checked)
    input: str | None = MISSING  # the photo's input (null: the only one)
    output: str | None = MISSING  # the map's output (null: the only one)
    mask: str | None = MISSING  # output that is below 0.5 where the map is invalid (null: none)
    error_output: str | None = MISSING  # output: the network's expected error, of ln depth or in radians (null: none)
    error_scale: float = MISSING  # with that error a pixel weighs half: 1 / (1 + (error / error_scale)^2)
    max_error: float = MISSING  # pixels with more are invalid
    flip: bool = MISSING  # average with the prediction of the mirrored photo
    intrinsics: str | None = MISSING  # input for the 3x3 intrinsics in its own pixels (null: none)
    tokens: str | None = MISSING  # input for the number of patches of `multiple` pixels a side (null: none)
    height: int | None = MISSING  # of the photo as the network sees it (null: the model's own)
    width: int | None = MISSING
    multiple: int = MISSING  # fit=cover: sides are multiples of this
    fit: str = MISSING  # stretch | pad (to height x width) | cover (keeps the aspect, no side smaller than that)
    layout: str = MISSING  # nchw | nhwc
    channels: str = MISSING  # rgb | bgr
    white: float = MISSING  # the photo's values are 0..white
    mean: list[float] = MISSING  # taken off the values, each channel's own
    std: list[float] = MISSING  # what they are then divided by
    output_channel: int | None = MISSING  # depth: this channel of the output (null: it has one)
    canonical_focal_px: float | None = MISSING  # depth: metres for this focal length (null: for the photo's)
    values: str = MISSING  # normals: signed (-1..1) | zero_to_one (n = 2 v - 1)


@dataclass
class DepthPriorConfig:
    """Depth maps of the photos, from a network or a sensor."""

    source: str = MISSING  # none | files | onnx | room_prior (the network that comes with room2dgs)
    path: str | None = MISSING  # folder of <photo's name>.png (16-bit) or .npy
    unit_m: float | None = MISSING  # metres of one stored unit (null: 0.001 for PNG, 1 for .npy)
    meaning: str = MISSING  # metric_depth | relative_depth | relative_inverse_depth
    align: bool = MISSING  # robust scale and shift of each map to the sparse points
    joint: bool = MISSING  # joint depth optimisation: smooth log-scale grids make views, points and normals agree
    manhattan: bool = MISSING  # and textureless walls and floors that nearly face one of the room's axes face it
    max_outlier_ratio: float = MISSING  # leave all maps out if more of the points, as a share, are 5 % off them
    max_residual: float = MISSING  # maps with a larger median relative residual are left out
    onnx: OnnxConfig = field(default_factory=OnnxConfig)


@dataclass
class NormalPriorConfig:
    """Normal maps of the photos; what their numbers mean must be said."""

    source: str = MISSING  # none | files | onnx | room_prior (the network that comes with room2dgs)
    path: str | None = MISSING  # folder of <photo's name>.png or .npy
    encoding: str = MISSING  # png8 (n = rgb / 127.5 - 1) | npy
    axes: str = MISSING  # opencv (x right, y down, z forward) | opengl (x right, y up, z back) | rdf, rub, rdb, ...
    facing: str = MISSING  # camera | away: the side that normals point to
    frame: str = MISSING  # camera | world
    check: bool = MISSING  # stop if another convention fits clearly better, leave out maps that say nothing
    onnx: OnnxConfig = field(default_factory=OnnxConfig)


@dataclass
class PriorConfig:
    """Maps that tell depth and normals of each photo beforehand."""

    depth: DepthPriorConfig = field(default_factory=DepthPriorConfig)
    normal: NormalPriorConfig = field(default_factory=NormalPriorConfig)
    cache: str | None = MISSING  # folder that keeps the networks' maps (null: priors in the run's folder)
    threads: int | None = MISSING  # of the networks (null: all cores that this process may use)
    provider: str = MISSING  # what runs the networks: cpu | cuda


@dataclass
class SeedsConfig:
    """Seeds and the surfels they spawn (eq. 8-9)."""

    init: str = MISSING  # sfm: voxels of the sparse points | sfm+depth | points: every point, as plain 2DGS
    voxel_m: float = MISSING  # delta
    depth_voxel_m: float = MISSING  # sfm+depth: one seed a cell where views agree on the depth prior and no point is
    per_seed: int = MISSING  # k surfels a seed
    neighbours: int = MISSING  # points for the local normal and scale
    opacity: float = MISSING  # initial opacity of every surfel
    max_scale_m: float = MISSING  # upper bound of the initial scale
    decoder: str = MISSING  # explicit: surfels store their attributes | shared: a network decodes them
    feature_size: int = MISSING  # numbers a seed that the shared decoder's network reads
    scale_activation: str = MISSING  # exp | softplus: what the learnt scale numbers mean


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
    """A loss term's weight and the iterations in which it acts; times below 1 are shares of train.iterations."""

    enabled: bool = MISSING
    weight: float = MISSING
    start: float = MISSING  # first iteration
    end: float | None = MISSING  # first iteration without it (null: never)
    ramp: float = MISSING  # iterations until it has its full weight


@dataclass
class MultiviewConfig:
    """What the multi-view terms compare: a view's pixels with a neighbouring view's (eq. 13-15)."""

    neighbours: int = MISSING  # at most this many a view; one is drawn each iteration
    max_angle_deg: float = MISSING  # between the optical axes of neighbours
    min_baseline_m: float = MISSING  # between their centres; nearer ones show no depth
    max_baseline_m: float = MISSING
    samples: int = MISSING  # pixels compared each iteration
    patch: int = MISSING  # side of the compared patches, pixels, odd
    min_std: float = MISSING  # patches of less contrast (grey levels of 0..1) are not compared


@dataclass
class NormalReweightingConfig:
    """Normals that disagree with what is rendered lose weight as training goes on; a time below 1 is a share of it."""

    enabled: bool = MISSING
    start: float = MISSING  # first iteration
    first_deg: float = MISSING  # angle that quarters a pixel's weight in L_n, at the start
    last_deg: float = MISSING  # and in the last iteration, reached exponentially


@dataclass
class LossConfig:
    """Loss terms; each has one toggle."""

    dssim: float = MISSING  # L_rgb = (1 - dssim) L1 + dssim D-SSIM
    distortion: TermConfig = field(default_factory=TermConfig)
    normal_consistency: TermConfig = field(default_factory=TermConfig)
    depth_prior: TermConfig = field(default_factory=TermConfig)  # acts on views that have a depth prior
    normal_prior: TermConfig = field(default_factory=TermConfig)  # acts on views that have a normal prior
    normal_reweighting: NormalReweightingConfig = field(default_factory=NormalReweightingConfig)
    multiview_geometric: TermConfig = field(default_factory=TermConfig)  # acts on views that have a neighbour
    multiview_photometric: TermConfig = field(default_factory=TermConfig)  # likewise
    multiview: MultiviewConfig = field(default_factory=MultiviewConfig)


@dataclass
class RatesConfig:
    """Adam's learning rates; `center` in metres for a scene of 1 m extent, as 2DGS has it."""

    center: float = MISSING
    center_final: float = MISSING  # reached exponentially at the last iteration
    rotation: float = MISSING
    scale: float = MISSING
    opacity: float = MISSING
    color: float = MISSING  # SH degree 0; the higher degrees learn at a twentieth
    feature: float = MISSING  # shared decoder: each seed's feature
    network: float = MISSING  # shared decoder: its network
    network_final: float = MISSING  # reached exponentially at the last iteration


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
class StrategyConfig:
    """Densification and pruning; times below 1 are shares of train.iterations."""

    name: str = MISSING  # fixed | seeds (the paper's growth and pruning) | plain (2DGS's densification)
    start: float = MISSING  # of the adjustments
    stop: float = MISSING  # of the adjustments
    every: int = MISSING  # iterations between two adjustments (the paper's N_g and N_alpha)
    grow_gradient: float = MISSING  # mean screen-space gradient that calls for growth (theta_g)
    min_visits: int = MISSING  # seeds: surfels seen in fewer iterations since the last adjustment have no say
    levels: int = MISSING  # seeds: of the hierarchy; each is 4 times finer, the last has cells of seeds.voxel_m
    random_survival: bool = MISSING  # seeds: of new seeds, half of the coarsest level's, 3/4 of the next, ...
    prune_opacity: float = MISSING  # less opaque ones go (theta_alpha)
    max_surfels: int | None = MISSING  # growth ends there, by falling gradient (null: never)
    split_size: float = MISSING  # plain: larger surfels split, others are cloned; a share of the scene's extent
    prune_size: float = MISSING  # plain: larger surfels go once opacities were reset; a share of the extent
    reset_every: float = MISSING  # plain: iterations between two resets of all opacities (0: none)


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
    strategy: StrategyConfig = field(default_factory=StrategyConfig)
    train: TrainConfig = field(default_factory=TrainConfig)
    mesh: MeshConfig = field(default_factory=MeshConfig)
    eval: EvalConfig = field(default_factory=EvalConfig)
