"""`prepare`: poses of photos that have none."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, PathText, Wants, expert, public

LENGTHS = "[height,METRES], [PHOTO,PHOTO,METRES] or [METRES]"


@dataclass(config=GROUP)
class PrepareConfig:
    """Which photos or frames of a video, how they are matched, and where the metres come from."""

    video: PathText | None = public(None, "Video without poses; video=FILE is short for it.")
    images: PathText | None = public(None, "Folder of photos without poses; images=DIR is short for it.")
    depth: PathText | None = expert(
        None, "Folder of a sensor's depth maps: 16-bit PNG in millimetres, with the names and the shape of the photos."
    )
    max_photos: Int = public(200, "Largest number of frames or photos that are used.", ge=5, le=5000)
    spacing: Float = expert(
        0.08, "Motion of the picture from one used frame to the next, as a share of its width.", gt=0, le=0.5
    )
    max_side: Int = expert(1920, "Largest longer side of the frames of a video, in pixels.", ge=160, le=8192)
    lens: Literal["SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE"] = expert(
        "SIMPLE_RADIAL", "COLMAP's camera model, whose parameters are estimated with the poses."
    )
    features: Int = expert(6000, "Largest number of SIFT features of a photo without a pose.", ge=100, le=50_000)
    peak_threshold: Float = expert(
        0.003, "Smallest contrast of a SIFT feature; a lower one finds more on plain walls.", gt=0, le=1
    )
    feature_side: Int = expert(
        1600, "Largest longer side of a photo in which features are searched, in pixels.", ge=160, le=8192
    )
    exhaustive: Int = expert(60, "Number of photos up to which each is matched with every other.", ge=0)
    overlap: Int = expert(
        10,
        "Number of following photos that a photo is matched with, where there are too many for all pairs.",
        ge=1,
        le=100,
    )
    loops: Int = expert(
        6,
        "Number of similar photos that a photo is matched with, to close loops, where not all pairs are.",
        ge=0,
        le=100,
    )
    length: Annotated[
        list[str] | None,
        Wants("[height,METRES] of the cameras, [PHOTO,PHOTO,METRES] between two, or [METRES] of their path"),
    ] = public(
        None,
        "Known length that gives the scale: [height,METRES] of the cameras above the floor, "
        "[PHOTO,PHOTO,METRES] between "
        "two photos, or [METRES] of the camera's path; 2.04+-0.01 says how sure it is.",
        min_length=1,
        max_length=3,
    )
    threads: Int | None = expert(
        None, "Threads of pycolmap (null: all cores of the process); photos are matched on one.", ge=1, le=1024
    )
