"""conf/prior: depth and normal maps of the photos."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, PathText
from room2dgs.config.groups.network import NETWORK_SOURCES, OnnxConfig
from room2dgs.config.groups.sensor import SensorConfig

Source = Literal["none", "files", "onnx", "room_prior"]
DepthSource = Literal["none", "files", "onnx", "room_prior", "sensor", "auto"]
Axes = Literal["opencv", "opengl", "rdf", "rub", "rdb", "ruf", "ldf", "lub", "ldb", "luf"]
SOURCES = "none | files | onnx | room_prior (the network that comes with room2dgs)"
DEPTH_SOURCES = f"{SOURCES} | sensor (the capture's depth files) | auto (sensor if it has them, else room_prior)"


@dataclass(config=GROUP)
class DepthPriorConfig:
    """Depth maps of the photos, from a network or a sensor."""

    source: DepthSource = Field(description=DEPTH_SOURCES)
    path: PathText | None = Field(description="folder of <photo's name>.png (16-bit) or .npy")
    unit_m: Float | None = Field(
        ge=1e-9, le=1e6, description="metres of one stored unit (null: 0.001 for PNG, 1 for .npy)"
    )
    meaning: Literal["metric_depth", "relative_depth", "relative_inverse_depth"] = Field(
        description="metric_depth | relative_depth | relative_inverse_depth"
    )
    align: bool = Field(description="robust scale and shift of each map to the sparse points (never a sensor's)")
    joint: bool = Field(
        description="joint depth optimisation: smooth log-scale grids make views, points and normals agree (likewise)"
    )
    manhattan: bool = Field(
        description="and textureless walls and floors that nearly face one of the room's axes face it"
    )
    completion: bool = Field(
        description="and each is drawn to what stereo found, and trusted by what the views then say of each other"
    )
    planes: bool = Field(description="and pixels that seem to lie on one of the room's large planes are drawn to it")
    right_angles: bool = Field(
        description="and planes that are almost parallel or at right angles, as far as is known, are so"
    )
    creases: bool = Field(
        description="and planes meet where the photos see them meet, as far as stereo does not know them better"
    )
    other_views: bool = Field(description="and each is drawn to what is sure in other views, projected into it")
    free_space: bool = Field(description="and what other views look through, by stereo's word, counts for less")
    second_pass: bool = Field(
        description="and stereo looks again, from the completed depth; then all of the above anew"
    )
    correction: bool = Field(
        description="and a network corrects what comes of this at each look; it has learnt from room_prior's depth"
    )
    sensor: SensorConfig = Field()
    onnx: OnnxConfig = Field()

    @property
    def passes(self) -> int:
        """How many times stereo runs, where it does."""
        return 2 if self.joint and self.completion and self.second_pass else 1

    @model_validator(mode="after")
    def _fits_together(self) -> DepthPriorConfig:
        _has_what_its_source_needs("depth", self)
        if self.source in ("sensor", "auto") and self.meaning != "metric_depth":
            raise ValueError(
                f"prior.depth.source={self.source} means metres, not prior.depth.meaning={self.meaning}; leave that out"
            )
        if self.source == "sensor" and (self.align or self.joint):
            raise ValueError(
                "prior.depth.source=sensor uses depth as it is; write prior/depth=sensor, without "
                "prior.depth.align=true and prior.depth.joint=true"
            )
        if self.source != "none" and not self.align and self.meaning != "metric_depth":
            raise ValueError(f"prior.depth.align=false needs metres, not {self.meaning}; align the maps")
        return self


@dataclass(config=GROUP)
class NormalPriorConfig:
    """Normal maps of the photos; what their numbers mean must be said."""

    source: Source = Field(description=SOURCES)
    path: PathText | None = Field(description="folder of <photo's name>.png or .npy")
    encoding: Literal["png8", "npy"] = Field(description="png8 (n = rgb / 127.5 - 1) | npy")
    axes: Axes = Field(
        description="opencv (x right, y down, z forward) | opengl (x right, y up, z back) | rdf, rub, rdb, ..."
    )
    facing: Literal["camera", "away"] = Field(description="camera | away: the side that normals point to")
    frame: Literal["camera", "world"] = Field(description="camera | world")
    check: bool = Field(description="stop if another convention fits clearly better, leave out maps that say nothing")
    onnx: OnnxConfig = Field()

    @model_validator(mode="after")
    def _fits_together(self) -> NormalPriorConfig:
        _has_what_its_source_needs("normal", self)
        if self.source in NETWORK_SOURCES and self.encoding != "npy":
            raise ValueError(
                f"prior.normal.source={self.source} makes maps of numbers; give prior.normal.encoding=npy with it"
            )
        return self


@dataclass(config=GROUP)
class PriorConfig:
    """Maps that tell depth and normals of each photo beforehand."""

    depth: DepthPriorConfig = Field()
    normal: NormalPriorConfig = Field()
    cache: PathText | None = Field(description="keeps the networks' maps (null: priors in the run's folder)")
    threads: Int | None = Field(
        ge=1, le=1024, description="of the networks (null: all cores that this process may use)"
    )
    provider: Literal["auto", "cpu", "cuda"] = Field(
        description="what runs the networks: auto (a GPU where onnxruntime has CUDA, else the CPU) | cpu | cuda"
    )

    @model_validator(mode="after")
    def _flipped_photos_have_normals_of_the_camera(self) -> PriorConfig:
        normal = self.normal  # not among its own rules: other frames are tried on its maps
        if normal.source in NETWORK_SOURCES and normal.onnx.flip and normal.frame == "world":
            raise ValueError(
                "prior.normal.onnx.flip=true needs normals in the camera's frame, not prior.normal.frame=world"
            )
        return self


def _has_what_its_source_needs(name: str, prior: DepthPriorConfig | NormalPriorConfig) -> None:
    if prior.source == "files" and not prior.path:
        raise ValueError(f"prior.{name}.source=files needs prior.{name}.path=DIR with a map for each photo")
    if prior.source == "onnx" and not prior.onnx.model:
        raise ValueError(f"prior.{name}.onnx.model=FILE is not given; get {prior.onnx.get}")
    if prior.source in ("room_prior", "auto") and not prior.onnx.output:
        raise ValueError(f"prior.{name}.source={prior.source} lacks its settings; write prior/{name}={prior.source}")
