"""Who may come in: the token of this start, by a name of this machine, and from no other page.

A page of somebody else in the same browser reaches the loopback too. It does not know the token; its own name is in
Origin, and, if it had its name lead here, in Host.
"""

from __future__ import annotations

import hmac
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple
from urllib.parse import parse_qs

LOOPBACK = "127.0.0.1"
NAMES_OF_LOOPBACK = (LOOPBACK, "localhost", "::1")
EVERYWHERE = {"0.0.0.0": LOOPBACK, "::": "::1"}  # and by what this machine itself gets there
HOST = re.compile(r"(\[[0-9a-fA-F:.]+\]|[^\s\[\]:/@\\?#]+)(:\d{1,5})?")
OK, SEE_OTHER, FORBIDDEN = 200, 303, 403


class Verdict(NamedTuple):
    """What becomes of a request.

    Attributes:
        status: OK, SEE_OTHER or FORBIDDEN.
        text: the path without the token; where else to look; why not.
    """

    status: int
    text: str


def new_token() -> str:
    """Fit for an address; nobody guesses it."""
    return secrets.token_urlsafe(24)


@dataclass(frozen=True)
class Door:
    """Decides on requests.

    Attributes:
        names: hosts and addresses that a browser may know this machine by, besides those of the loopback and the
            address that the request came to.
        token: a part of the path, or `?token=`.
    """

    names: tuple[str, ...] = ()
    token: str = field(default_factory=new_token, repr=False)

    def decide(
        self, target: str, hosts: Sequence[str], origins: Sequence[str], came_to: str, upgrade: bool = False
    ) -> Verdict:
        """Of one request.

        Args:
            target: path and query, as the browser sent them.
            hosts, origins: all headers of these names. Programs that are no browsers send no Origin.
            came_to: this end's address of the connection.
            upgrade: to a websocket.
        """
        if len(hosts) != 1 or not self._known(hosts[0], came_to):
            return Verdict(FORBIDDEN, "This machine is not known by that name; give it as host=ADDRESS,NAME.")
        here = hosts[0].lower()
        if len(origins) > 1 or any(origin.lower() not in (f"http://{here}", f"https://{here}") for origin in origins):
            return Verdict(FORBIDDEN, "Pages of another address may not look.")
        path, _, query = target.partition("?")
        _, first, *rest = path.split("/", 2) if path.startswith("/") else ("", "")
        if self._same(first):
            return Verdict(OK, "/" + "".join(rest))
        if any(map(self._same, parse_qs(query).get("token", ()))) and path == "/":
            return Verdict(OK, "/") if upgrade else Verdict(SEE_OTHER, f"/{self.token}/")
        return Verdict(FORBIDDEN, "The address needs the token; open it as it was printed when this viewer started.")

    def _known(self, host: str, came_to: str) -> bool:
        match = HOST.fullmatch(host)
        # any port: of a tunnel's other end it is another one, and what Host says is compared with Origin as it is
        return match is not None and match[1].strip("[]").lower() in {*NAMES_OF_LOOPBACK, came_to, *self.names}

    def _same(self, given: str) -> bool:
        return hmac.compare_digest(given.encode("utf-8", "surrogateescape"), self.token.encode())


def names_of(host: str) -> tuple[str, tuple[str, ...]]:
    """The address to listen at, and all that `host=ADDRESS,NAME,...` names, in lower case."""
    names = tuple(name.strip().strip("[]").lower() for name in host.split(",") if name.strip())
    return names[0] if names else LOOPBACK, names


def in_url(host: str) -> str:
    """A host as addresses have it."""
    return f"[{host}]" if ":" in host else host
