"""`room2dgs depth`: dense depth of a capture's photos by stereo, and a first mesh without any training."""

from __future__ import annotations

from collections.abc import Sequence

from room2dgs.commands.own_arguments import choices, own_arguments
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.pipeline.depth_maps import depth_of_capture
from room2dgs.runs.folder import new_run

USAGE = "room2dgs depth DIR out=DIR [fill=true] [stereo.KEY=VALUE ...] [mesh.KEY=VALUE ...]"


def main(argv: list[str]) -> int:
    """Compare the photos with each other: depth, normals, expected errors and consistent views of each, a coloured
    point cloud (dense.ply), a mesh of the depth alone (mesh.ply), and a report of coverage and time (report.html,
    coverage.json).

    Where photos tell no depth, of a camera that only turned, maps and cloud are empty and there is no mesh; report and
    coverage say so.

    The maps are .npy files called by the views' names (a photo's without its ending, with _ for folders): depth in
    metres (0 = none), unit normals in the world frame, errors in metres.
    `room2dgs run ... prior/depth=files prior.depth.path=OUT/depth prior.depth.align=false` trains with them.
    fill=true fills what stereo leaves empty with the network's depth (prior=room_prior), drawn to stereo's: filled/ and
    filled_confidence/ beside the others, and the mesh is of these.
    """
    if asked_for_help(argv):
        return show(argv, USAGE, main.__doc__, ("scene", "points", "stereo", "prior", "mesh", "report"))
    own, rest = own_arguments(argv, ("fill",))
    fill = choices(own, "fill", "false", ("true", "false")) == ("true",)
    depth_of_capture(new_run(_with_prior(rest) if fill else rest), fill)
    return 0


def _with_prior(overrides: Sequence[str]) -> list[str]:
    """The overrides, and the network as prior unless they choose another."""
    chosen = any(text.partition("=")[0] in ("prior", "prior/depth") for text in overrides)
    return [*([] if chosen else ["prior=room_prior"]), *overrides]
