"""`scene`: the capture."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, REQUIRED, Float, Folder, Int, Name, PathText, Wants, expert, public
from room2dgs.registries.readers import READERS


def layouts() -> tuple[str, ...]:
    """What a capture's layout can be called."""
    return ("auto", *READERS.names())


@dataclass(config=GROUP)
class SceneConfig:
    """Which frames of which capture, at which size; and what its numbers mean, where its layout does not tell."""

    path: Folder = public(REQUIRED, "Folder of the capture, or its file.")
    layout: Annotated[str, Name(layouts)] = public(
        "auto", "Layout of the capture. auto: it is recognised by its files."
    )
    frames: Int | None = public(None, "Number of frames that are used, evenly spaced (null: all).", ge=3)
    stride: Int = public(1, "Step between used frames of the capture: 2 uses every second.", ge=1)
    keyframes: Float = expert(
        1.0,
        "Share of the training photos whose depth and normals are estimated; they are chosen to differ most, "
        "and stereo "
        "compares them with all others.",
        gt=0,
        le=1,
    )
    image_width: Annotated[
        Literal["auto", "full"] | Annotated[Int, Field(ge=16, le=8192)],
        Wants("auto, full or a whole number from 16 to 8192"),
    ] = public(
        "auto",
        "Width in pixels at which photos are worked; they are never enlarged. auto: photos whose longer side has more "
        "than 1600 pixels are worked at 1600. full: all pixels.",
    )
    intrinsics: list[Float] | None = expert(
        None, "Intrinsics [fx,fy,cx,cy] in pixels of the photos (null: the capture's own).", min_length=4, max_length=4
    )
    pixel_centres: Literal["auto", "integer", "half"] = expert(
        "auto",
        "Where the centre of the first pixel lies in the capture's intrinsics. auto: as its layout says. "
        "integer: at 0, "
        "as in OpenCV. half: at 0.5, as in COLMAP.",
    )
    poses: Literal[
        "auto",
        "camera_to_world_opencv",
        "camera_to_world_opengl",
        "world_to_camera_opencv",
        "world_to_camera_opengl",
    ] = expert("auto", "What the capture's poses mean. auto: as its layout says.")
    unit: Annotated[
        Literal["auto"] | Annotated[Float, Field(gt=0)], Wants("auto or a number above 0, the metres of one unit")
    ] = public(
        "auto",
        "Metres of one unit of the capture's poses. auto: 1 where the capture says that they are metres; else it is "
        "estimated from the depth prior, if one is read.",
    )
    exposure: Annotated[Literal["auto"] | Annotated[bool, Strict()], Wants("auto, true or false")] = public(
        "auto",
        "Whether colours are brought to one exposure and white balance, estimated from places that several photos see. "
        "auto: where the photos vary.",
    )
    topics: list[str] | None = expert(
        None, "Topics of a ROS bag that are read where it has several pictures, depths or poses (null: the only ones)."
    )
    pose_frame: str | None = expert(None, "ROS frame whose poses a topic holds that does not name it.")
    split: Literal["capture", "every"] = public(
        "capture",
        "Which photos are held out for tests. capture: the capture's own test photos if it has any. every: every "
        "scene.test_every-th.",
    )
    test_every: Int = public(8, "Step between held-out frames: 8 holds out every eighth used frame (0: none).", ge=0)
    gt_mesh: PathText | None = public(None, "Mesh of the true surface (null: the one in the capture, if any).")

    @property
    def given_unit(self) -> float | None:
        """Metres of one unit, if they are given."""
        return None if self.unit == "auto" else self.unit
