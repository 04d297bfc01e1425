"""viser's server behind our door: no request and no message reaches it unchecked."""

from __future__ import annotations

import asyncio
import contextlib
import io
import socket
import threading
from collections.abc import Callable
from importlib import import_module
from typing import Any

from room2dgs.errors import InputError
from room2dgs.viewer.door import FORBIDDEN, OK, Door, in_url
from room2dgs.viewer.messages import LONGEST, Fit, fitting

PORTS = 1000  # from the wanted one on; viser waits for ever if none of those that it tries is free
HEADERS = {"Referrer-Policy": "no-referrer", "Cache-Control": "no-store"}  # the address holds the token
_one_start = threading.Lock()


def guarded_server(viser: Any, host: str, port: int, door: Door, controls: dict[str, Fit]) -> Any:
    """A `viser.ViserServer` that listens.

    viser has no setting for who may look. It hands its handlers to `websockets.asyncio.server.serve`; they are wrapped
    there while it starts.

    Args:
        host, port: where; the next port that is free.
        controls: see `messages.fitting`; controls are added as they are made.

    Raises:
        InputError: the address cannot be used, or this version of viser starts in another way.
    """
    port = free_port(host, port)
    websockets_server: Any = import_module("websockets.asyncio.server")
    wrapped = []
    with _one_start:
        serve = websockets_server.serve

        def guarded(handler: Callable, *args: Any, process_request: Callable | None = None, **options: Any) -> Any:
            wrapped.append(True)
            options |= {"process_request": door_check(door, process_request), "max_size": LONGEST}
            return serve(fitting_messages_only(handler, controls), *args, **options)

        websockets_server.serve = guarded
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # it prints the address, without the token
                server = viser.ViserServer(host=host, port=port, label="room2dgs", verbose=False)
        finally:
            websockets_server.serve = serve
    if not wrapped:
        server.stop()
        raise InputError(
            f"viser {viser.__version__} starts its server in a way in which nobody could be kept out; install another "
            "version: pip install viser==1.1.1"
        )
    return server


def door_check(door: Door, inside: Callable | None) -> Callable:
    """What `websockets` asks about each request, before `inside` is."""
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    def process_request(connection: Any, request: Any) -> Any:
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        upgrade = bool(request.headers.get_all("Upgrade"))
        came_to = connection.local_address[0].partition("%")[0]
        verdict = door.decide(request.path, hosts, origins, came_to, upgrade)
        if verdict.status == OK:
            request.path = verdict.text
            answer = None if inside is None else inside(connection, request)
            if answer is not None:
                answer.headers.update(HEADERS)
            return answer
        body = f"{verdict.text}\n".encode()
        headers = Headers(**HEADERS, **{"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))})
        if verdict.status != FORBIDDEN:
            headers["Location"] = verdict.text
        return Response(verdict.status, "Forbidden" if verdict.status == FORBIDDEN else "See Other", headers, body)

    return process_request


def fitting_messages_only(handler: Callable, controls: dict[str, Fit]) -> Callable:
    """A handler of connections that hears fitting messages alone."""
    import msgspec

    async def behind(connection: Any) -> None:
        receive = connection.recv

        async def fitting_ones(*args: Any, **options: Any) -> bytes:
            while True:
                raw = await receive(*args, **options)
                with contextlib.suppress(msgspec.DecodeError, ValueError, RecursionError, TypeError):
                    message = fitting(msgspec.msgpack.decode(raw), controls)
                    if message is not None:
                        return msgspec.msgpack.encode(message)
                await asyncio.sleep(0)  # others have their turn, however many there are

        connection.recv = fitting_ones
        await handler(connection)

    return behind


def free_port(host: str, port: int) -> int:
    """The first from `port` on that can be listened at.

    Raises:
        InputError: the host is none of this machine's, or there is no such port.
    """
    where = f"{in_url(host)}:{port}"
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError) as error:
        raise InputError(f"host={host} is no address of this machine ({error}); leave host= out or give one") from error
    problem: OSError | None = None
    for number in range(port, min(port + PORTS, 65536)):
        problem = _why_not(addresses, number)
        if problem is None:
            return number
    raise InputError(
        f"{where} cannot be listened at ({problem.strerror if problem else 'no such port'}); "
        "give another host=, an address of this machine, or another port="
    )


def _why_not(addresses: list, port: int) -> OSError | None:
    for family, kind, protocol, _, address in addresses:
        try:
            with socket.socket(family, kind, protocol) as one:
                one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                if family == socket.AF_INET6:
                    one.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
                one.bind((address[0], port, *address[2:]))
                one.listen(1)  # some systems refuse a foreign address, or a port that is taken, only here
        except OSError as error:
            return error
    return None
