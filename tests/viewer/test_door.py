"""Who is let in: only with the token, by a known name, from no other page; on HTTP and on the websocket's handshake."""

from __future__ import annotations

import http.client
import socket

import numpy as np
import pytest

from room2dgs.errors import InputError
from room2dgs.viewer import guarded_server
from room2dgs.viewer.door import FORBIDDEN, OK, SEE_OTHER, Door, in_url, names_of
from room2dgs.viewer.server import Viewer

DOOR = Door(("room.example", "0.0.0.0"), "the-token")
HERE = "127.0.0.1:8080"
UP = np.array([0, -1.0, 0])


def decided(target: str, host: str = HERE, *origins: str, came_to: str = "127.0.0.1", upgrade: bool = False):
    return DOOR.decide(target, [host], origins, came_to, upgrade)


def test_the_token_opens_and_is_taken_out_of_the_path():
    assert decided("/the-token") == (OK, "/")
    assert decided("/the-token/") == (OK, "/")
    assert decided("/the-token/a/b.js?x=1") == (OK, "/a/b.js")
    assert decided("/?token=the-token") == (SEE_OTHER, "/the-token/")
    assert decided("/?token=the-token", upgrade=True) == (OK, "/")


@pytest.mark.parametrize(
    "target",
    ["/", "", "/the-toke", "/the-token2/", "/?token=", "/?token=other", "/?other=the-token", "/a?token=the-token", "//",
     "/%74he-token/", "/the-tokeñ", "the-token", "/\udcff"],
)  # fmt: skip
def test_without_the_token_nobody_comes_in(target):
    for upgrade in (False, True):
        assert decided(target, upgrade=upgrade).status == FORBIDDEN


@pytest.mark.parametrize(
    "host", [HERE, "localhost:8080", "LOCALHOST:1", "[::1]:8080", "127.0.0.1", "room.example:80", "0.0.0.0:8080"]
)
def test_known_names_are_let_in_from_their_own_pages_alone(host):
    assert decided("/the-token", host).status == OK
    assert decided("/the-token", host, f"http://{host}").status == OK
    assert decided("/the-token", host, f"https://{host}").status == OK
    for origin in (
        "http://evil.example",
        "null",
        "",
        "http://localhost:3000",
        f"http://{host}.evil.example",
        "file://",
    ):
        assert decided("/the-token", host, origin).status == FORBIDDEN
    assert decided("/the-token", host, f"http://{host}", "http://evil.example").status == FORBIDDEN


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:8080", "127.0.0.1.evil.example:8080", "localhost@evil.example", "evil#127.0.0.1", "",
     ":8080", "127.0.0.1:8080:8080", "[::1", "127.0.0.1:port", "10.0.0.7:8080"],
)  # fmt: skip
def test_a_name_that_leads_here_is_not_enough(host):
    assert decided("/the-token", host, f"http://{host}").status == FORBIDDEN


def test_the_address_that_a_request_came_to_is_known_and_there_is_one_host():
    assert decided("/the-token", "10.0.0.7:8080", came_to="10.0.0.7").status == OK
    for hosts in ([], [HERE, HERE], [HERE, "evil.example"]):
        assert DOOR.decide("/the-token", hosts, [], "127.0.0.1").status == FORBIDDEN


def test_each_start_has_a_token_of_its_own_and_hides_it():
    one, other = Door(), Door()
    assert one.token != other.token and len(one.token) >= 32
    assert one.token not in repr(one)


def test_names_are_read_from_the_setting():
    assert names_of("0.0.0.0, Room.Example,[::1]") == ("0.0.0.0", ("0.0.0.0", "room.example", "::1"))
    assert names_of("") == ("127.0.0.1", ())
    assert in_url("::1") == "[::1]" and in_url("localhost") == "localhost"


@pytest.fixture(scope="module")
def viewer(wall_surfels):
    pytest.importorskip("viser", reason="viser is missing (the extra `view`)")
    viewer = Viewer(wall_surfels, UP, port=guarded_server.free_port("127.0.0.1", 18_080))
    yield viewer
    viewer.stop()


def asked(viewer: Viewer, target: str, **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", viewer.port, timeout=10)
    connection.putrequest("GET", target, skip_host=True)
    for name, value in ({"Host": f"127.0.0.1:{viewer.port}"} | headers).items():
        connection.putheader(name, value)
    connection.endheaders()
    return connection.getresponse()


def test_the_page_is_behind_the_door(viewer):
    assert viewer.url == f"http://127.0.0.1:{viewer.port}/?token={viewer.door.token}"
    there = asked(viewer, f"/?token={viewer.door.token}")
    assert there.status == SEE_OTHER
    page = asked(viewer, there.headers["Location"], Origin=f"http://127.0.0.1:{viewer.port}")
    assert page.status == OK and page.headers["Referrer-Policy"] == "no-referrer" and b"<html" in page.read()
    assert asked(viewer, "/").status == FORBIDDEN
    assert asked(viewer, f"/{viewer.door.token}/", Host="evil.example").status == FORBIDDEN
    assert asked(viewer, f"/{viewer.door.token}/", Origin="http://evil.example").status == FORBIDDEN


def test_so_is_the_websocket(viewer):
    client = pytest.importorskip("websockets.sync.client")
    import viser
    from websockets.exceptions import InvalidStatus

    host = f"127.0.0.1:{viewer.port}"
    options = {"subprotocols": [f"viser-v{viser.__version__}"], "max_size": None}
    for path, headers in (
        ("", {}),
        ("/", {"Origin": f"http://{host}"}),
        ("/?token=other", {}),
        (f"/{viewer.door.token}", {"Origin": "http://evil.example"}),
        (f"/{viewer.door.token}", {"Origin": "null"}),
    ):
        with pytest.raises(InvalidStatus) as refused:
            client.connect(f"ws://{host}{path}", additional_headers=headers, **options)
        assert refused.value.response.status_code == FORBIDDEN
    with pytest.raises(InvalidStatus):
        name = f"ws://evil.example:{viewer.port}/{viewer.door.token}"  # a name that leads here
        client.connect(name, sock=socket.create_connection(("127.0.0.1", viewer.port)), **options)
    for path in (viewer.door.token, f"?token={viewer.door.token}"):
        with client.connect(f"ws://{host}/{path}", additional_headers={"Origin": f"http://{host}"}, **options) as here:
            assert here.recv(timeout=10)


def test_a_viser_that_starts_otherwise_is_refused(monkeypatch, wall_surfels):
    viser = pytest.importorskip("viser", reason="viser is missing (the extra `view`)")
    ended = []

    class Otherwise:
        def __init__(self, **_):
            pass

        def stop(self):
            ended.append(True)

    monkeypatch.setattr(viser, "ViserServer", Otherwise)
    with pytest.raises(InputError, match="nobody could be kept out"):
        Viewer(wall_surfels, UP)
    assert ended == [True]


@pytest.mark.parametrize("host", ["192.0.2.1", "no-such-machine.invalid", "2001:db8::1", "a b"])
def test_an_address_of_another_machine_is_a_sentence_and_does_not_wait(wall_surfels, host):
    pytest.importorskip("viser", reason="viser is missing (the extra `view`)")
    with pytest.raises(InputError, match="host="):
        Viewer(wall_surfels, UP, host=host)


def test_a_port_that_is_taken_leads_to_the_next_and_the_last_to_a_sentence():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        if port < 65_535:
            assert guarded_server.free_port("127.0.0.1", port) > port
    with socket.create_server(("127.0.0.1", 65_535)), pytest.raises(InputError, match="another port="):
        guarded_server.free_port("127.0.0.1", 65_535)
