"""A network's card: the JSON file that says what goes into an ONNX model and what its outputs mean.

The cards of known networks are conf/_networks/NAME.json. Any other model has its card beside it, model.json beside
model.onnx, or `prior.depth.card` and `prior.normal.card` say where it is.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, REQUIRED, Float, Int
from room2dgs.config.folder import conf_dir
from room2dgs.errors import InputError
from room2dgs.registries.depth_sources import DEPTH_SOURCES
from room2dgs.regular_files import read_regular

if TYPE_CHECKING:
    from room2dgs.config.groups.prior import DepthPriorConfig, NormalPriorConfig, PriorConfig

FOLDER = "_networks"  # in conf/
VERSION = 1  # of the card's keys
LARGEST = 1 << 16  # bytes
KINDS = ("depth", "normal")
GUIDE = "docs/how-to/networks.md shows one"

Side = Annotated[Int, Field(ge=1, le=8192)]
Mean = Annotated[Float, Field(ge=-1e6, le=1e6)]
Deviation = Annotated[Float, Field(ge=1e-6, le=1e6)]


@dataclass(config=GROUP, frozen=True)
class CardInput:
    """How a photo goes in.

    Attributes:
        name: of the photo's input (null: the only one).
        intrinsics: name of the input for the 3x3 intrinsics in pixels of the input (null: none).
        tokens: name of the input for the number of patches of `multiple` pixels a side (null: none).
        height, width: pixels of the input (null: as the model fixes them).
        multiple: with fit "cover" both sides are multiples of it.
        fit: "stretch" to height x width; "pad": fitted into it; "cover": the smallest size with the photo's aspect that
            covers it.
        layout, channels: order of the axes and of the colours.
        white: the photo's values are 0 to this.
        mean, std: taken off the values, which are then divided by std; of each channel.
        flip: predictions of the photo and of its mirror image are averaged.
    """

    name: str | None = None
    intrinsics: str | None = None
    tokens: str | None = None
    height: Side | None = None
    width: Side | None = None
    multiple: Annotated[Int, Field(ge=1, le=256)] = 1
    fit: Literal["stretch", "pad", "cover"] = "stretch"
    layout: Literal["nchw", "nhwc"] = "nchw"
    channels: Literal["rgb", "bgr"] = "rgb"
    white: Annotated[Float, Field(ge=1e-3, le=65535)] = 1.0
    mean: tuple[Mean, Mean, Mean] = (0.0, 0.0, 0.0)
    std: tuple[Deviation, Deviation, Deviation] = (1.0, 1.0, 1.0)
    flip: bool = False


@dataclass(config=GROUP, frozen=True)
class CardOutput:
    """Where a map comes out.

    Attributes:
        output: name of the map's output (null: the only one).
        mask: name of an output that is below 0.5 where the map is invalid (null: none).
        error: name of an output that is the expected error, of ln depth or in radians (null: none).
    """

    output: str | None = None
    mask: str | None = None
    error: str | None = None


@dataclass(config=GROUP, frozen=True)
class CardViews:
    """How several photos of one room go in together.

    Attributes:
        count: photos at a time; for a file that does not fix it: what it was traced with (null: as the file fixes it).
        poses: name of the input for the poses (null: none).
        pose: "cam_from_world", also called extrinsics or w2c, or "world_from_cam", also called c2w; OpenCV's axes.
        origin: "world", or "first": the first photo's camera is the world.
        unit: of the translations: "metres", or "median_distance": the lower median of the distances of all the photos'
            cameras from the first, its own 0 among them, at least 0.1 m.
        answers: whether "all" photos get a map, or the "first".
    """

    count: Annotated[Int, Field(ge=2, le=64)] | None = None
    poses: str | None = None
    pose: Literal["cam_from_world", "world_from_cam"] = "cam_from_world"
    origin: Literal["world", "first"] = "first"
    unit: Literal["metres", "median_distance"] = "metres"
    answers: Literal["all", "first"] = "all"


@dataclass(config=GROUP, frozen=True)
class CardDepth(CardOutput):
    """What the depth output means.

    Attributes:
        meaning: as `prior.depth.meaning`.
        channel: of the output that is depth (null: it has one); 2 of points in each photo's camera frame.
        canonical_focal_px: focal length for which depth is metric (null: the photo's).
        confidence: name of an output above 0, the larger the surer depth is, in any unit. Of several photos together
            alone (null: none).
    """

    meaning: Literal["metric_depth", "scaled_depth", "relative_depth", "relative_inverse_depth"] = Field(
        default=REQUIRED
    )
    channel: Annotated[Int, Field(ge=0, le=255)] | None = None
    canonical_focal_px: Annotated[Float, Field(ge=1, le=1e5)] | None = None
    confidence: str | None = None


@dataclass(config=GROUP, frozen=True)
class CardNormal(CardOutput):
    """What the normal output means.

    Attributes:
        axes, facing: as `prior.normal.axes` and `prior.normal.facing`.
        values: "signed": -1 to 1; "zero_to_one": n = 2 v - 1.
    """

    axes: Literal["opencv", "opengl", "rdf", "rub", "rdb", "ruf", "ldf", "lub", "ldb", "luf"] = "opencv"
    facing: Literal["camera", "away"] = "camera"
    values: Literal["signed", "zero_to_one"] = "signed"


@dataclass(config=GROUP, frozen=True)
class Card:
    """The file as a whole.

    Attributes:
        card: version of its keys.
        about: which network it is, and what is known of its exports.
        get: where the .onnx file comes from.
        licence: of the model.
        sha256: of the .onnx file (null: not checked).
        input: how a photo goes in.
        views: how several photos go in together (null: one at a time).
        depth, normal: the maps that come out; at least one of them.
    """

    card: Literal[1]
    about: str = ""
    get: str = "your own export of a network"
    licence: str = ""
    sha256: Annotated[str, Field(pattern="^[0-9a-fA-F]{64}$")] | None = None
    input: CardInput = Field(default_factory=CardInput)
    views: CardViews | None = None
    depth: CardDepth | None = None
    normal: CardNormal | None = None


def card_names() -> tuple[str, ...]:
    """The networks whose cards come with room2dgs."""
    return tuple(sorted(path.stem for path in (conf_dir() / FOLDER).glob("*.json")))


def where_from(network: str | None) -> str:
    """The end of the sentence that a model is missing."""
    return f"; get {read_card(_known(network)).get}" if network else "; get a depth or normal network in ONNX"


def card_of(part: DepthPriorConfig | NormalPriorConfig, kind: str) -> Card:
    """The card of the network that makes a prior's maps.

    Args:
        kind: "depth" or "normal".

    Raises:
        InputError: there is none, it cannot be used, it has no map of this kind, or it is of a network that sees
            several photos at a time where the prior's sees one, or the other way round.
    """
    if part.card:
        path = Path(part.card)
    elif part.network:
        path = _known(part.network)
    else:
        path = Path(part.model or "").with_suffix(".json")
        if not path.is_file():
            raise InputError(
                f"{part.model} has no card: write {path} beside it ({GUIDE}), give prior.{kind}.card=FILE, or "
                "name a known "
                f"network by prior/{kind}=NAME"
            )
    card = read_card(path)
    if getattr(card, kind) is None:
        raise InputError(f"{path} is the card of a network without {kind}; choose another prior/{kind}")
    several = DEPTH_SOURCES.get(part.source).facts["several"]
    if several and card.views is None:
        raise InputError(f"{path} is the card of a network that sees one photo at a time; give prior/{kind}=onnx")
    if card.views is not None and not several:
        raise InputError(
            f"{path} is the card of a network that sees several photos at a time; give prior/depth=onnx_multiview"
        )
    return card


def with_conventions(prior: PriorConfig, sources: Sequence[str]) -> PriorConfig:
    """The priors with what their maps mean: what the settings leave open is as the networks' cards say.

    Args:
        sources: those that are networks.

    Raises:
        InputError: as `card_of`, or normals in the world's frame of a network that sees mirrored photos.
        ValidationError: settings that do not fit what the card says.
    """
    depth, normal = prior.depth, prior.normal
    if depth.meaning is None:
        card = card_of(depth, "depth").depth if depth.source in sources else None
        depth = replace(depth, meaning=card.meaning if card else "metric_depth")
    if normal.axes is None or normal.facing is None:
        meant = card_of(normal, "normal").normal if normal.source in sources else None
        meant = meant or CardNormal()
        normal = replace(normal, axes=normal.axes or meant.axes, facing=normal.facing or meant.facing)
    if normal.source in sources and normal.frame == "world" and card_of(normal, "normal").input.flip:
        raise InputError(
            "prior.normal.frame=world does not fit a network that sees mirrored photos (input.flip in its card); give "
            "prior.normal.frame=camera"
        )
    return prior if (depth, normal) == (prior.depth, prior.normal) else replace(prior, depth=depth, normal=normal)


@lru_cache(maxsize=32)
def _parsed(path: Path, text: bytes) -> Card:
    try:
        values: Any = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is no JSON ({str(error).splitlines()[0]}); {GUIDE}") from error
    if not isinstance(values, dict) or "card" not in values:
        raise InputError(f'{path} is no network\'s card: it does not begin with "card": {VERSION}; {GUIDE}')
    try:
        card = TypeAdapter(Card).validate_python(values)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        what = {"unexpected_keyword_argument": "is no key of a card", "missing": "is missing"}.get(first["type"])
        raise InputError(f"{path} is no network's card: {place} {what or _should(first)}; {GUIDE}") from error
    wrong = _contradiction(card)
    if wrong:
        raise InputError(f"{path} is no network's card: {wrong}; {GUIDE}")
    return card


def _contradiction(card: Card) -> str | None:
    if card.depth is None and card.normal is None:
        return "it has neither depth nor normal"
    if card.views is None:
        return "depth.confidence belongs to views" if card.depth and card.depth.confidence else None
    if card.depth is None or card.normal is not None:
        return "several photos at a time (views) give depth and no normals"
    if card.input.flip or card.input.tokens:
        return "input.flip and input.tokens are of one photo at a time, not of views"
    if card.depth.confidence and card.depth.error:
        return "depth.confidence and depth.error say the same thing"
    return None


def read_card(path: Path) -> Card:
    """A card.

    Raises:
        InputError: it is missing or cannot be used; the message names the key.
    """
    return _parsed(path, read_regular(path, LARGEST, GUIDE))


def _should(error: Any) -> str:
    return f"is {error['input']!r} and {str(error['msg']).replace('Input should', 'should')}"


def _known(network: str | None) -> Path:
    return conf_dir() / FOLDER / f"{network}.json"
