"""What a mesh is made of: the values of `mesh.source`."""

from __future__ import annotations

from typing import Any

from room2dgs.registry import Registry

MESHERS: Registry[Any] = Registry("mesher")
MESHERS.register(
    "surfels",
    "room2dgs.commands.mesh:mesh_scene",
    "Trains surfels and fuses the depth that they render.",
    trains=True,
    reads_priors=True,
)
MESHERS.register(
    "depth",
    "room2dgs.commands.mesh_of_depth:mesh_of_depth",
    "Fuses the prior depth of stereo, a network or a sensor, without training.",
    trains=False,
    reads_priors=True,
)
MESHERS.register(
    "stereo",
    "room2dgs.commands.mesh_of_stereo:mesh_of_stereo",
    "Fuses stereo's depth alone, without priors and training.",
    trains=False,
    reads_priors=False,
)
MESHERS.register(
    "points",
    "room2dgs.commands.mesh_of_points:mesh_of_points",
    "Reconstructs the surface of the sparse points alone by screened Poisson reconstruction.",
    trains=False,
    reads_priors=False,
)
