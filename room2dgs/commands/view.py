"""`room2dgs view`: walk through an earlier run."""

from __future__ import annotations

import threading

from room2dgs.commands.own_arguments import own_arguments, whole_number
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.runs.folder import earlier_run

USAGE = "room2dgs view RUN [host=127.0.0.1[,NAME,...]] [port=8080] [fps=15]"
OWN = ("host", "port", "fps")


def main(argv: list[str]) -> int:
    """Serve an earlier run to a browser on this machine until Ctrl-C: walk through it; switch between colour, depth,
    normals, mesh and error; show seeds, cameras and their photos; measure between two clicked points.

    A run that trained nothing, by mesh.source, shows its mesh instead of surfels.

    The address that is printed holds a token; who does not have it is not let in. host= lets others look: without it
    nobody but this machine can; host=0.0.0.0,NAME names what browsers elsewhere call this machine. Needs viser: pip
    install 'room2dgs[view]'.
    """
    if asked_for_help(argv):
        return show(argv, USAGE, main.__doc__, ("render",))
    own, overrides = own_arguments(argv, OWN)
    config = earlier_run(overrides)
    fps, port = whole_number(own, "fps", 15, 1, 60), whole_number(own, "port", 8080, 1, 65535)
    print(f"reading {config.out}", flush=True)  # before the libraries, which take seconds
    from room2dgs.viewer.door import LOOPBACK, names_of
    from room2dgs.viewer.guarded_server import free_port

    host = own.get("host") or LOOPBACK
    free_port(names_of(host)[0], port)  # reported now if it cannot be, not after the run is read
    from room2dgs.pipeline.view import viewer_of
    from room2dgs.viewer.server import warn_of_host

    viewer = viewer_of(config, host, port, fps)
    try:
        viewer.start()
        warn_of_host(host, print)
        # on a line of its own: terminals take what follows an address for part of it
        print(f"look at {viewer.url}\nCtrl-C ends it", flush=True)
        threading.Event().wait()
    finally:
        viewer.stop()
    return 0
