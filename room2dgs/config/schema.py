"""The whole configuration: one field for each group of settings."""

from __future__ import annotations

from operator import attrgetter
from typing import Annotated

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, REQUIRED, Folder, Name, expert, group, public
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
from room2dgs.config.names import described
from room2dgs.registries.decoders import DECODERS
from room2dgs.registries.meshers import MESHERS
from room2dgs.registries.primitives import PRIMITIVES
from room2dgs.registries.strategies import STRATEGIES


@dataclass(config=GROUP)
class Config:
    """The whole configuration of a run."""

    out: Folder = public(REQUIRED, "Folder of the run.")
    resume: bool = public(False, "Whether the run in `out` goes on from its last checkpoint.")
    strict: bool = public(False, "Whether `run` ends with exit code 3 if the verdict on the run is `failed`.")
    primitive: Annotated[str, Name(PRIMITIVES.names)] = expert(
        "surfel2d", described("Primitive that the scene is made of.", PRIMITIVES)
    )
    prepare: PrepareConfig = group(PrepareConfig)
    scene: SceneConfig = Field(default=REQUIRED)
    sfm: SfmConfig = group(SfmConfig)
    points: PointsConfig = group(PointsConfig)
    stereo: StereoConfig = group(StereoConfig)
    prior: PriorConfig = group(PriorConfig)
    seeds: SeedsConfig = group(SeedsConfig)
    render: RenderConfig = group(RenderConfig)
    loss: LossConfig = group(LossConfig)
    strategy: StrategyConfig = group(StrategyConfig)
    train: TrainConfig = group(TrainConfig)
    mesh: MeshConfig = group(MeshConfig)
    eval: EvalConfig = group(EvalConfig)
    report: ReportConfig = group(ReportConfig)
    export: ExportConfig = group(ExportConfig)
    memory: MemoryConfig = group(MemoryConfig)

    @model_validator(mode="after")
    def _groups_fit_together(self) -> Config:
        self._decoder_fits()
        self._strategy_fits()
        self._mesher_fits()
        return self

    def _decoder_fits(self) -> None:
        name, degree = self.seeds.decoder, self.render.sh_degree
        most = DECODERS.get(name).facts.get("max_sh_degree")
        if most is not None and degree > most:
            others = [entry.name for entry in DECODERS.entries() if entry.facts.get("max_sh_degree") is None]
            raise ValueError(
                f"render.sh_degree={degree} needs seeds.decoder={' or '.join(others)}; "
                f"seeds.decoder={name} has colours up to degree {most} alone"
            )

    def _strategy_fits(self) -> None:
        entry = STRATEGIES.get(self.strategy.name)
        needs = entry.facts.get("needs", {})
        if any(attrgetter(key)(self) != value for key, value in needs.items()):
            given = " and ".join(f"{key}={value}" for key, value in needs.items())
            raise ValueError(f"strategy={entry.name} works with single primitives; give {given}")

    def _mesher_fits(self) -> None:
        source = self.mesh.source
        if self.stereo.enabled or not MESHERS.get(source).facts["needs_stereo"]:
            return
        untrained = (one for one in MESHERS.entries() if not one.facts["trains"] and not one.facts["needs_stereo"])
        others = " or ".join(one.name for one in untrained)
        raise ValueError(
            f"mesh.source={source} is nothing without stereo; give stereo.enabled=true, or mesh.source={others}"
        )
