"""The layouts of captures, in the order in which they are asked whether a capture is theirs.

A new layout is a module with a `Reader` (room2dgs.captures.reader) and one line here. Another package brings one by an
entry point of the group "room2dgs.readers", whose name is the layout's:

    [project.entry-points."room2dgs.readers"]
    mylayout = "mypackage.mylayout:READER"
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.registry import Registry

if TYPE_CHECKING:
    from room2dgs.captures.reader import Reader

READERS: Registry[Reader] = Registry("layout", "room2dgs.readers", ("recognise", "read", "contains"))

_AT = "room2dgs.captures.readers"
READERS.register("sens", f"{_AT}.sens:READER", "ScanNet's .sens file.")
READERS.register("ros", f"{_AT}.ros:READER", "A bag of ROS 1 or ROS 2.")
READERS.register("record3d", f"{_AT}.record3d:READER", "A capture of the app Record3D.")
READERS.register("scannetpp", f"{_AT}.scannetpp:READER", "A scene of ScanNet++, by DSLR or iPhone.")
READERS.register("polycam", f"{_AT}.polycam:READER", "A raw export of the app Polycam.")
READERS.register("stray", f"{_AT}.stray:READER", "A capture of the app Stray Scanner.")
READERS.register("arkitscenes", f"{_AT}.arkitscenes:READER", "A scene of ARKitScenes.")
READERS.register("scannet", f"{_AT}.scannet:READER", "A scene of ScanNet as folders of photos, depth and poses.")
READERS.register("replica", f"{_AT}.replica:READER", "A sequence of Replica as NICE-SLAM renders it.")
READERS.register("tum", f"{_AT}.tum:READER", "A sequence of the TUM RGB-D benchmark.")
READERS.register("sevenscenes", f"{_AT}.sevenscenes:READER", "A sequence of 7-Scenes.")
READERS.register("monosdf", f"{_AT}.monosdf:READER", "A scene as MonoSDF preprocesses it.")
READERS.register("sdfstudio", f"{_AT}.sdfstudio:READER", "A scene of SDFStudio.")
READERS.register("nerfstudio", f"{_AT}.nerfstudio:READER", "A transforms.json of nerfstudio, instant-ngp or Blender.")
READERS.register("neuralrgbd", f"{_AT}.neuralrgbd:READER", "A scene of Neural RGB-D Surface Reconstruction.")
READERS.register("colmap", f"{_AT}.colmap:READER", "A model of COLMAP, binary or text.")
READERS.register("open3d", f"{_AT}.open3d_log:READER", "Photos with a trajectory .log of Open3D.")
READERS.register("metashape", f"{_AT}.metashape:READER", "Cameras that Agisoft Metashape exported as XML.")
