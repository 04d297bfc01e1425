"""The whole configuration: one field for each Hydra group of conf/."""

from __future__ import annotations

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Folder
from room2dgs.config.groups.eval import EvalConfig
from room2dgs.config.groups.export import ExportConfig
from room2dgs.config.groups.loss import LossConfig
from room2dgs.config.groups.memory import MemoryConfig
from room2dgs.config.groups.mesh import MeshConfig
from room2dgs.config.groups.points import PointsConfig
from room2dgs.config.groups.prepare import PrepareConfig
from room2dgs.config.groups.prior import PriorConfig
from room2dgs.config.groups.render import RenderConfig
from room2dgs.config.groups.report import ReportConfig
from room2dgs.config.groups.scene import SceneConfig
from room2dgs.config.groups.seeds import SeedsConfig
from room2dgs.config.groups.sfm import SfmConfig
from room2dgs.config.groups.stereo import StereoConfig
from room2dgs.config.groups.strategy import StrategyConfig
from room2dgs.config.groups.train import TrainConfig


@dataclass(config=GROUP)
class Config:
    """The whole configuration of a run."""

    out: Folder = Field(description="the run's folder")
    resume: bool = Field(description="go on from the last checkpoint in `out`")
    prepare: PrepareConfig = Field()
    scene: SceneConfig = Field()
    sfm: SfmConfig = Field()
    points: PointsConfig = Field()
    stereo: StereoConfig = Field()
    prior: PriorConfig = Field()
    seeds: SeedsConfig = Field()
    render: RenderConfig = Field()
    loss: LossConfig = Field()
    strategy: StrategyConfig = Field()
    train: TrainConfig = Field()
    mesh: MeshConfig = Field()
    eval: EvalConfig = Field()
    report: ReportConfig = Field()
    export: ExportConfig = Field()
    memory: MemoryConfig = Field()

    @model_validator(mode="after")
    def _groups_fit_together(self) -> Config:
        if self.seeds.decoder == "shared" and self.render.sh_degree > 0:
            raise ValueError(
                f"render.sh_degree={self.render.sh_degree} needs seeds.decoder=explicit; "
                "seeds.decoder=shared has colours of degree 0 alone"
            )
        if self.mesh.source == "stereo" and not self.stereo.enabled:
            raise ValueError(
                "mesh.source=stereo is nothing without stereo; give stereo.enabled=true, or mesh.source=depth or points"
            )
        if self.strategy.name == "plain" and (self.seeds.per_seed, self.seeds.decoder) != (1, "explicit"):
            raise ValueError(
                "strategy=plain is densification of single surfels; give seeds.per_seed=1 and seeds.decoder=explicit"
            )
        return self
