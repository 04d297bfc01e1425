"""`room2dgs app`: a page on this machine that makes runs."""

from __future__ import annotations

import webbrowser
from pathlib import Path

from room2dgs.commands.own_arguments import choices, own_arguments, whole_number
from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.errors import InputError

USAGE = "room2dgs app [out=runs] [port=8090] [browser=true]"
OWN = ("out", "port", "browser")


def main(argv: list[str]) -> int:
    """Serve a page to this machine's browser until Ctrl-C: drop a folder with photos or a video, choose how fine, watch
    the run, look at its page. Each run gets a folder in out=.

    The address that is printed holds a token; nobody but this machine, and nobody without it, is let in.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    own, rest = own_arguments(argv, OWN)
    if rest:
        raise InputError(f"{rest[0]} is not known here: {USAGE}")
    port = whole_number(own, "port", 8090, 1, 65535)
    (browser,) = choices(own, "browser", "true", ("true", "false"))
    from room2dgs.app.server import App
    from room2dgs.viewer.door import LOOPBACK
    from room2dgs.viewer.guarded_server import free_port

    out = Path(own.get("out") or "runs").expanduser().absolute()
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}); choose another out=DIR") from error
    app = App(out, free_port(LOOPBACK, port))
    # on a line of its own: terminals take what follows an address for part of it
    print(f"open {app.url}\nruns are made in {out}; Ctrl-C ends it", flush=True)
    if browser == "true":
        webbrowser.open(app.url)
    try:
        app.serve()
    finally:
        app.close()
    return 0
