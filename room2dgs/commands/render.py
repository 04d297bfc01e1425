"""`room2dgs render`: photo, colour, depth and normals of a run's views side by side, or views along a path."""

from __future__ import annotations

from pathlib import Path

from room2dgs.commands.own_arguments import choices, own_arguments, whole_number
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.errors import InputError
from room2dgs.pipeline.camera_path import SAVED, PathOptions, render_path
from room2dgs.pipeline.loaded_run import loaded_surfels
from room2dgs.pipeline.render import VIEWS, write_renders
from room2dgs.runs.folder import earlier_run

USAGE = """room2dgs render RUN [views=test|train|all]
room2dgs render RUN path=smooth|FILE [to=DIR] [save=color,depth,depth_npy,normals,video]
                        [frames=N] [through=N] [fps=N] [width=N]"""
OWN = ("views", "path", "to", "save", "frames", "fps", "width", "through")  # arguments that are no settings


def main(argv: list[str]) -> int:
    """Draw an earlier run: its held-out views (or training views) beside the photos; or, with path=, what cameras see
    along a smooth path through the captured views (path=smooth), or from a camera file (path=FILE: a transforms.json,
    or a folder with a COLMAP model, in the world of the run).

    save= says what of a path is written to to=DIR (RUN/renders/NAME): color (PNG), depth (16-bit PNG, millimetres),
    depth_npy (float32, metres), normals (PNG), video (MP4 of the colours); color,video unless said otherwise.
    frames= (240) and through= (12 of the captured views) are a smooth path's; fps= (30) the video's; width= in pixels.
    """
    if asked_for_help(argv):
        return show(argv, USAGE, main.__doc__, ("render",))
    own, overrides = own_arguments(argv, OWN)
    views = own.get("views", "test")
    if views not in VIEWS:
        raise InputError(f"views={views} is not known; choose from {', '.join(VIEWS)}")
    path = _path_options(own)
    config = earlier_run(overrides)
    with loaded_surfels(config) as (scene, surfels, run):
        if path is not None:
            render_path(path, scene, surfels, config, run)
        else:
            write_renders(scene, surfels, config, run, views)
    return 0


def _path_options(own: dict[str, str]) -> PathOptions | None:
    """The arguments of a path; None: none is asked for."""
    given = [name for name in own if name != "views"]
    if not given:
        return None
    if not own.get("path"):
        raise InputError(f"{given[0]}= is for a path; add path=smooth or path=FILE")
    if "views" in own:
        raise InputError("views= and path= exclude each other; leave one out")
    default = PathOptions()
    return PathOptions(
        path=own["path"],
        to=Path(own["to"]).expanduser().absolute() if own.get("to") else None,
        save=choices(own, "save", ",".join(default.save), SAVED),
        frames=whole_number(own, "frames", default.frames, 1, 100_000),
        through=whole_number(own, "through", default.through, 2, 100_000),
        fps=whole_number(own, "fps", default.fps, 1, 240),
        width=whole_number(own, "width", 0, 16, 16384) or None,
    )
