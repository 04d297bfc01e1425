"""`prior`: depth and normal maps of the photos."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.card import card_names, where_from
from room2dgs.config.fields import GROUP, Float, Int, Name, PathText, expert, group, public
from room2dgs.config.groups.sensor import SensorConfig
from room2dgs.config.names import described
from room2dgs.registries.depth_sources import DEPTH_SOURCES

Meaning = Literal["metric_depth", "scaled_depth", "relative_depth", "relative_inverse_depth"]
Axes = Literal["opencv", "opengl", "rdf", "rub", "rdb", "ruf", "ldf", "lub", "ldb", "luf"]
Side = Literal["camera", "away"]
NETWORK_SOURCES = tuple(entry.name for entry in DEPTH_SOURCES.entries() if entry.facts["network"])
# those that see one photo at a time
ONE_PHOTO_SOURCES = tuple(name for name in NETWORK_SOURCES if not DEPTH_SOURCES.get(name).facts["several"])


def normal_sources() -> tuple[str, ...]:
    """Sources that give normals."""
    return tuple(entry.name for entry in DEPTH_SOURCES.entries() if entry.facts["normals"])


@dataclass(config=GROUP)
class DepthPriorConfig:
    """Depth maps of the photos, from a network or a sensor."""

    source: Annotated[str, Name(DEPTH_SOURCES.names)] = expert(
        "auto",
        described("Where prior depth comes from; prior/depth=NAME sets it with all that belongs to it.", DEPTH_SOURCES),
    )
    path: PathText | None = public(None, "Folder of depth maps: <name of the photo>.png (16-bit) or .npy.")
    unit_m: Float | None = expert(
        None, "Metres of one stored unit of a depth map (null: 0.001 for PNG, 1 for .npy).", ge=1e-9, le=1e6
    )
    meaning: Meaning | None = public(
        None,
        "What depth maps hold (null: what the network's card says, else metres). scaled_depth: depth up to scale. "
        "relative_depth: up to scale and shift. relative_inverse_depth: disparity up to scale and shift, as of MiDaS.",
    )
    model: PathText | None = public(
        None, "The .onnx file of the depth network (null: the one that comes with room2dgs)."
    )
    network: Annotated[str, Name(card_names)] | None = expert(
        "room_prior", "Known network whose card describes prior.depth.model (null: the card beside the model)."
    )
    card: PathText | None = expert(
        None, "Card (.json) that describes prior.depth.model, in place of its network's and of the one beside it."
    )
    error_scale: Float = expert(
        0.1,
        "Relative standard deviation at which a depth weighs half: 1 / (1 + (sigma / error_scale)^2).",
        ge=1e-6,
        le=1e3,
    )
    max_error: Float = expert(0.5, "Largest relative standard deviation of a valid depth.", ge=1e-6, le=1e6)
    align: bool = expert(
        True, "Whether each depth map is scaled and shifted to the sparse points; a depth camera's never is."
    )
    joint: bool = expert(
        True,
        "Whether smooth grids of log-scale are optimised jointly, so that depths of all views, points and "
        "normals agree; "
        "a depth camera's are left alone.",
    )
    manhattan: bool = expert(
        True, "Whether textureless walls and floors that nearly face an axis of the room are turned to face it."
    )
    completion: bool = expert(
        True,
        "Whether depth maps are completed from stereo's depth samples, with a standard deviation from the "
        "consistency of "
        "views.",
    )
    planes: bool = expert(True, "Whether depth that seems to lie on a large plane of the room is moved onto it.")
    right_angles: bool = expert(
        True, "Whether planes of the room that are nearly parallel or at right angles are made exactly so."
    )
    creases: bool = expert(
        True, "Whether planes are refined to meet at the creases that photos show, where stereo does not know better."
    )
    other_views: bool = expert(
        True, "Whether depth maps are drawn to the sure depth of other views, projected into them."
    )
    free_space: bool = expert(True, "Whether depth that other views look through, by stereo's depth, loses weight.")
    second_pass: bool = public(
        True, "Whether stereo runs a second pass from the completed depth, followed by all steps of the first."
    )
    correction: bool = expert(
        True, "Whether a network corrects the completed depth of each pass; it is trained on room_prior's depth."
    )
    sensor: SensorConfig = group(SensorConfig)

    @property
    def passes(self) -> int:
        """How many times stereo runs, where it does."""
        return 2 if self.joint and self.completion and self.second_pass else 1

    @model_validator(mode="after")
    def _fits_together(self) -> DepthPriorConfig:
        _has_what_its_source_needs("depth", self)
        if self.source in ("sensor", "auto") and self.meaning not in (None, "metric_depth"):
            raise ValueError(
                f"prior.depth.source={self.source} means metres, not prior.depth.meaning={self.meaning}; leave that out"
            )
        if self.source == "sensor" and (self.align or self.joint):
            raise ValueError(
                "prior.depth.source=sensor uses depth as it is; write prior/depth=sensor, without "
                "prior.depth.align=true and prior.depth.joint=true"
            )
        if self.source != "none" and not self.align and self.meaning not in (None, "metric_depth"):
            raise ValueError(f"prior.depth.align=false needs metres, not {self.meaning}; align the maps")
        return self


@dataclass(config=GROUP)
class NormalPriorConfig:
    """Normal maps of the photos; what their numbers mean must be said."""

    source: Annotated[str, Name(normal_sources)] = expert(
        "room_prior", "Where prior normals come from; prior/normal=NAME sets it with all that belongs to it."
    )
    path: PathText | None = public(None, "Folder of normal maps: <name of the photo>.png or .npy.")
    model: PathText | None = public(
        None, "The .onnx file of the normal network (null: the one that comes with room2dgs)."
    )
    network: Annotated[str, Name(card_names)] | None = expert(
        "room_prior", "Known network whose card describes prior.normal.model (null: the card beside the model)."
    )
    card: PathText | None = expert(
        None, "Card (.json) that describes prior.normal.model, in place of its network's and of the one beside it."
    )
    error_scale: Float = expert(  # 20 degrees
        0.35,
        "Standard deviation in radians at which a normal weighs half: 1 / (1 + (sigma / error_scale)^2).",
        ge=1e-6,
        le=1e3,
    )
    max_error: Float = expert(1.0, "Largest standard deviation in radians of a valid normal.", ge=1e-6, le=1e6)
    encoding: Literal["png8", "npy"] = expert(
        "npy", "How normal maps are stored. png8: n = rgb / 127.5 - 1, black is invalid. npy: the numbers themselves."
    )
    axes: Axes | None = expert(
        None,
        "Axes of the stored normals (null: what the network's card says, else opencv). opencv: x right, y "
        "down, z forward. "
        "opengl: x right, y up, z back. Or a letter for each axis: r or l, d or u, f or b.",
    )
    facing: Side | None = expert(
        None,
        "Side that the stored normals point to (null: what the network's card says, else camera). camera: a wall seen "
        "frontally is (0, 0, -1) in the axes opencv.",
    )
    frame: Literal["camera", "world"] = expert(
        "camera", "Frame of the stored normals; world is the frame of the poses."
    )
    check: bool = expert(
        True,
        "Whether a run stops where another convention of the normals fits clearly better, and leaves out "
        "normals that say "
        "nothing.",
    )

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

    depth: DepthPriorConfig = group(DepthPriorConfig)
    normal: NormalPriorConfig = group(NormalPriorConfig)
    cache: PathText | None = public(None, "Folder that keeps the networks' maps (null: `priors` in the run's folder).")
    threads: Int | None = expert(None, "Threads of the networks (null: all cores of the process).", ge=1, le=1024)
    provider: Literal["auto", "cpu", "cuda"] = public(
        "auto", "What runs the networks. auto: a GPU where onnxruntime has CUDA, else the CPU."
    )


def _has_what_its_source_needs(name: str, prior: DepthPriorConfig | NormalPriorConfig) -> None:
    if prior.source == "files" and not prior.path:
        raise ValueError(f"prior.{name}.source=files needs prior.{name}.path=DIR with a map for each photo")
    if prior.source in ("room_prior", "auto") and prior.network != "room_prior":
        raise ValueError(f"prior.{name}.source={prior.source} lacks its settings; write prior/{name}={prior.source}")
    if prior.source in ("onnx", "onnx_multiview") and not prior.model:
        raise ValueError(f"prior.{name}.model=FILE is not given{where_from(prior.network)}")
