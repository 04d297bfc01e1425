"""What a mesh is made of: the values of `mesh.source`, the first of which is the method's own.

Each entry is a function `surface` (room2dgs.pipeline.meshers.mesher.Mesher). Its facts:

    trains: it is given trained surfels.
    reads_priors: the run reads priors, whatever it is that `prior` says.
    needs_stereo: it is nothing without `stereo.enabled`.
    made_of: what the mesh is of, for the log: "of the sparse points alone".
    on_page: the same as a sentence for the report of a run that trains nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.registry import Registry

if TYPE_CHECKING:
    from room2dgs.pipeline.meshers.mesher import Mesher

MESHERS: Registry[Mesher] = Registry("mesher")
MESHERS.register(
    "surfels",
    "room2dgs.pipeline.meshers.surfels:surface",
    "Trains surfels and fuses the depth that they render.",
    trains=True,
    reads_priors=True,
    needs_stereo=False,
    made_of="surfels",
    on_page="",
)
MESHERS.register(
    "depth",
    "room2dgs.pipeline.meshers.depth:surface",
    "Fuses the prior depth of stereo, a network or a sensor, without training.",
    trains=False,
    reads_priors=True,
    needs_stereo=False,
    made_of="depth",
    on_page="its depth maps were fused as they are",
)
MESHERS.register(
    "stereo",
    "room2dgs.pipeline.meshers.stereo:surface",
    "Fuses stereo's depth alone, without priors and training.",
    trains=False,
    reads_priors=False,
    needs_stereo=True,
    made_of="stereo's depth",
    on_page="the depth that stereo found was fused as it is, without priors",
)
MESHERS.register(
    "points",
    "room2dgs.pipeline.meshers.points:surface",
    "Reconstructs the surface of the sparse points alone by screened Poisson reconstruction.",
    trains=False,
    reads_priors=False,
    needs_stereo=False,
    made_of="the sparse points",
    on_page="its sparse points were made a surface (screened Poisson reconstruction)",
)
