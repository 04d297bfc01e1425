"""All writers, and what each layout can hold."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from room2dgs.tools.capture_layouts.benchmarks import monosdf, neuralrgbd, open3d, replica, sdfstudio, sevenscenes, tum
from room2dgs.tools.capture_layouts.colmap import colmap, colmap_binary
from room2dgs.tools.capture_layouts.made import Made
from room2dgs.tools.capture_layouts.metashape import metashape
from room2dgs.tools.capture_layouts.phones import arkitscenes, polycam, polycam_zip, record3d, record3d_archive, stray
from room2dgs.tools.capture_layouts.ros import ros1, ros2, ros_mcap
from room2dgs.tools.capture_layouts.scannet import scannet, scannet_flat, scannet_frames, sens
from room2dgs.tools.capture_layouts.scannetpp import scannetpp_dslr, scannetpp_iphone, scannetpp_json
from room2dgs.tools.capture_layouts.transforms import instant_ngp, nerfstudio


class Layout(NamedTuple):
    """A way to write a scene.

    Attributes:
        write: (folder, scene); the folder is not there yet.
        name: `scene.layout` of what is written.
        depth: whether its depth is written; points: sparse points with tracks.
        told: whether the capture's reader has to be told the intrinsics, or whose poses they are.
    """

    write: Callable[[Path, Made], None]
    name: str
    depth: bool = True
    points: bool = False
    told: str = ""

    def settings(self, made: Made) -> dict[str, Any]:
        """What a person has to say of such a capture: changes of `SceneConfig`."""
        if self.told == "intrinsics":
            return {"intrinsics": made.counted_at_integers, "pixel_centres": "integer"}
        return {"pose_frame": "camera"} if self.told == "pose_frame" else {}


LAYOUTS: dict[str, Layout] = {
    "scannet": Layout(scannet, "scannet"),
    "scannet_frames": Layout(scannet_frames, "scannet"),
    "scannet_flat": Layout(scannet_flat, "scannet"),
    "sens": Layout(sens, "sens"),
    "colmap": Layout(colmap, "colmap", depth=False, points=True),
    "colmap_binary": Layout(colmap_binary, "colmap", depth=False, points=True),
    "nerfstudio": Layout(nerfstudio, "nerfstudio"),
    "instant_ngp": Layout(instant_ngp, "nerfstudio", depth=False),
    "scannetpp_dslr": Layout(scannetpp_dslr, "scannetpp", depth=False, points=True),
    "scannetpp_json": Layout(scannetpp_json, "scannetpp", depth=False),
    "scannetpp_iphone": Layout(scannetpp_iphone, "scannetpp", points=True),
    "replica": Layout(replica, "replica"),
    "tum": Layout(tum, "tum", told="intrinsics"),
    "sevenscenes": Layout(sevenscenes, "sevenscenes", depth=False, told="intrinsics"),
    "neuralrgbd": Layout(neuralrgbd, "neuralrgbd", told="intrinsics"),
    "monosdf": Layout(monosdf, "monosdf", depth=False),
    "sdfstudio": Layout(sdfstudio, "sdfstudio", depth=False),
    "polycam": Layout(polycam, "polycam"),
    "polycam_zip": Layout(polycam_zip, "polycam"),
    "record3d": Layout(record3d, "record3d", depth=False),
    "record3d_archive": Layout(record3d_archive, "record3d"),
    "stray": Layout(stray, "stray"),
    "arkitscenes": Layout(arkitscenes, "arkitscenes"),
    "open3d": Layout(open3d, "open3d", told="intrinsics"),
    "metashape": Layout(metashape, "metashape", depth=False),
    "ros1": Layout(ros1, "ros"),
    "ros2": Layout(ros2, "ros"),
    "ros_mcap": Layout(ros_mcap, "ros", told="pose_frame"),
}
