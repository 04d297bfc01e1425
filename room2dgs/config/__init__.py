"""Settings: composed by Hydra, validated by pydantic at the fields' own bounds."""

from room2dgs.config.folder import conf_dir
from room2dgs.config.groups.eval import EvalConfig
from room2dgs.config.groups.loss import LossConfig, MultiviewConfig, NormalReweightingConfig, TermConfig
from room2dgs.config.groups.mesh import MeshConfig
from room2dgs.config.groups.points import PointsConfig
from room2dgs.config.groups.prepare import PrepareConfig
from room2dgs.config.groups.prior import (
    NETWORK_SOURCES,
    ONE_PHOTO_SOURCES,
    DepthPriorConfig,
    NormalPriorConfig,
    PriorConfig,
)
from room2dgs.config.groups.render import RenderConfig
from room2dgs.config.groups.report import ReportConfig
from room2dgs.config.groups.scene import SceneConfig
from room2dgs.config.groups.seeds import SeedsConfig
from room2dgs.config.groups.sensor import SensorConfig
from room2dgs.config.groups.sfm import SfmConfig
from room2dgs.config.groups.stereo import StereoConfig
from room2dgs.config.groups.strategy import StrategyConfig
from room2dgs.config.groups.train import FloorConfig, RatesConfig, ResolutionConfig, TrainConfig
from room2dgs.config.load import dump_config, load_config
from room2dgs.config.schema import Config

__all__ = [
    "NETWORK_SOURCES",
    "ONE_PHOTO_SOURCES",
    "Config",
    "DepthPriorConfig",
    "EvalConfig",
    "FloorConfig",
    "LossConfig",
    "MeshConfig",
    "MultiviewConfig",
    "NormalPriorConfig",
    "NormalReweightingConfig",
    "PointsConfig",
    "PrepareConfig",
    "PriorConfig",
    "RatesConfig",
    "RenderConfig",
    "ReportConfig",
    "ResolutionConfig",
    "SceneConfig",
    "SeedsConfig",
    "SensorConfig",
    "SfmConfig",
    "StereoConfig",
    "StrategyConfig",
    "TermConfig",
    "TrainConfig",
    "conf_dir",
    "dump_config",
    "load_config",
]
