"""The server with a client that speaks viser's protocol: pictures arrive, clicks measure, only the loopback listens."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.eval.pictures import error_mesh
from room2dgs.eval.surface import Surface
from room2dgs.mesh.io import write_mesh
from room2dgs.pipeline.camera_path import PathOptions, path_frames
from room2dgs.pipeline.scene import scene_of_run
from room2dgs.pipeline.view import viewer_of
from room2dgs.runs.folder import write_config
from room2dgs.train import save_surfels
from room2dgs.viewer import server
from room2dgs.viewer.pace import Pace
from room2dgs.viewer.picture import hit
from room2dgs.viewer.server import Browser, Viewer, distance_text, found_viser, full_size, warn_of_host

pytest.importorskip("viser", reason="viser is missing (the extra `view`)")
client_of = pytest.importorskip("websockets.sync.client")


@contextmanager
def serving(surfels, **options):
    viewer = Viewer(surfels, np.array([0, -1.0, 0]), port=_free_port(), fps=20, **options)
    try:
        viewer.start()
        yield viewer
    finally:
        viewer.stop()


@contextmanager
def connected(viewer):
    import viser

    protocol = f"viser-v{viser.__version__}"
    address = f"ws://127.0.0.1:{viewer.port}/{viewer.door.token}"
    with client_of.connect(address, subprotocols=[protocol], max_size=None) as socket_:
        yield socket_


def send(socket_, message) -> None:
    import msgspec

    socket_.send(msgspec.msgpack.encode(message.as_serializable_dict()))


def moved_to(x: float, fov: float = 1.0):
    from viser import _messages

    return _messages.ViewerCameraMessage(
        (1.0, 0, 0, 0), (x, 0.0, 0.0), fov, 0.01, 100.0, 120, 160, (x, 0.0, 1.0), (0.0, -1.0, 0.0)
    )


def set_to(control, value):
    from viser import _messages

    return _messages.GuiUpdateMessage(control._impl.uuid, {"value": value})


def clicked_along(direction):
    from viser import _messages

    return _messages.ScenePointerMessage("click", (0.0, 0, 0), direction, ((0.5, 0.5),), None)


def until(condition, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing came of it"
        time.sleep(0.02)


def pictures_of(video: bytes, path) -> list[np.ndarray]:
    """(H, W, 3) uint8 RGB of each picture."""
    path.write_bytes(video)
    film, found = cv2.VideoCapture(str(path)), []
    while (read := film.read())[0]:
        found.append(read[1][..., ::-1])
    return found


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def test_a_client_is_shown_what_it_looks_at_and_can_measure(wall_surfels):
    with serving(wall_surfels) as viewer:
        assert viewer.url.startswith("http://127.0.0.1:") and not viewer.watched
        with connected(viewer) as socket_:
            send(socket_, moved_to(0.0))
            until(lambda: viewer.watched)
            (browser,) = viewer._browsers.values()
            until(lambda: browser.drawn and browser.drawn[-1])  # it stands: drawn at full size
            first = browser.drawn
            send(socket_, moved_to(0.1))
            until(lambda: browser.drawn != first and browser.drawn[-1])
            viewer.show(wall_surfels)
            until(lambda: browser.drawn[0] == 1)
            viewer._measure.value = True
            send(socket_, clicked_along((0.0, 0.0, 1.0)))
            until(lambda: len(browser.marks) == 1)
            send(socket_, clicked_along((-0.5, 0.0, 1.0)))
            until(lambda: "1.000 m" in viewer._message.content)  # from (0, 0, 2) to (-1, 0, 2)
        until(lambda: not viewer.watched)
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.1", viewer.port), timeout=1)


def test_nobody_can_open_a_tunnel_and_only_the_loopback_listens(wall_surfels):
    with serving(wall_surfels) as viewer:
        assert viewer._server.request_share_url() is None and viewer._server._share_tunnel is None
        assert viewer._server.get_host() == "127.0.0.1"
        others = {one[4][0] for one in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
        for address in others - {"127.0.0.1", "127.0.1.1"}:
            with pytest.raises(OSError):
                socket.create_connection((address, viewer.port), timeout=1)


def test_what_one_browser_says_never_ends_the_pictures_of_another(wall_surfels):
    with serving(wall_surfels) as viewer, connected(viewer) as good, connected(viewer) as bad:
        send(good, moved_to(0.0))
        until(lambda: len(viewer._browsers) == 1)
        (browser,) = viewer._browsers.values()
        rate = next(one for one in viewer._server.gui._gui_input_handle_from_uuid.values() if one.value == 20)
        for fov in (0.0, -1.0, 1e308, float("nan"), float("inf")):
            send(bad, moved_to(0.0, fov))
        send(bad, moved_to(1e308))
        bad.send(b"\x93" * 1000)
        bad.send("text")
        send(bad, set_to(rate, 1e308))
        until(lambda: rate.value == 30 and len(viewer._browsers) == 2)  # brought between its ends
        send(bad, set_to(rate, "many"))
        send(bad, set_to(viewer._kind, "no such picture"))
        send(bad, set_to(viewer._measure, [1]))
        send(bad, clicked_along((0.0, 0.0, 0.0)))
        send(bad, moved_to(0.3))
        for x in (0.1, 0.2):
            before = browser.drawn
            send(good, moved_to(x))
            until(lambda before=before: browser.drawn != before and browser.drawn[-1])
        assert rate.value == 30 and viewer._kind.value == "colour" and viewer._measure.value is False
        with connected(viewer) as later:  # all that was said before is sent to those who come later
            assert later.recv(timeout=10)
            send(later, moved_to(0.0))
            until(lambda: len(viewer._browsers) == 3)


def test_a_picture_that_fails_costs_itself(wall_surfels, monkeypatch, capsys):
    with serving(wall_surfels) as viewer, connected(viewer) as one, connected(viewer) as other:
        draw = Viewer._draw

        def failing(self, browser):
            if browser.client.client_id == 0:
                raise RuntimeError("nothing to see")
            return draw(self, browser)

        monkeypatch.setattr(Viewer, "_draw", failing)
        send(one, moved_to(0.0))
        send(other, moved_to(0.0))
        until(lambda: 1 in viewer._browsers and viewer._browsers[1].drawn and viewer._browsers[1].drawn[-1])
        send(other, moved_to(0.1))
        before = viewer._browsers[1].drawn
        until(lambda: viewer._browsers[1].drawn != before)
        assert viewer._thread.is_alive()
    assert capsys.readouterr().err.count("nothing to see") == 1  # told once, not with each picture


@pytest.mark.parametrize(("aspect", "size"), [(2.0, (1280, 640)), (0.001, (3, 2560)), (1e5, (1280, 1))])
def test_no_window_asks_for_a_picture_without_end(aspect, size):
    assert full_size(aspect, 1280) == size


def test_another_host_is_warned_of():
    said = []
    for host in ("127.0.0.1", "localhost", "localhost,room.example", "0.0.0.0"):
        warn_of_host(host, said.append)
    assert len(said) == 1 and "0.0.0.0" in said[0]


def test_distances_are_said_to_the_millimetre():
    assert distance_text(np.zeros(3), np.array([0.3, 0.4, 1.2])) == "1.300 m"
    assert found_viser().__name__ == "viser"


def test_a_run_is_shown_with_its_mesh_its_error_and_its_cameras(wall, wall_surfels, tmp_path):
    config = load_config([f"scene.path={wall}", f"out={tmp_path}"])
    save_surfels(tmp_path / "surfels.safetensors", wall_surfels, {})
    mesh = trimesh.load(wall / "gt_mesh.ply", process=False)
    write_mesh(tmp_path / "mesh.ply", mesh)
    write_mesh(tmp_path / "eval" / "error.ply", error_mesh(mesh, Surface(mesh), 0.05))
    kinds = []
    for scores in ("{}", '{"protocol": "area"}'):  # the error of an earlier mesh is not this one's
        (tmp_path / "metrics.json").write_text(scores)
        viewer = viewer_of(config, "127.0.0.1", _free_port(), 15)
        kinds.append(viewer._kind.options)
        names = {
            name for name in viewer._server.scene._handle_from_node_name if name.startswith(("/cameras/", "/photos/"))
        }
        viewer.stop()
        assert len(names) == 16
    assert kinds == [("colour", "depth", "normals", "mesh"), ("colour", "depth", "normals", "mesh", "error")]


@pytest.mark.parametrize("source", ["depth", "points"])
def test_a_run_that_trained_nothing_is_shown_by_its_mesh(wall, tmp_path, source):
    config = load_config([f"scene.path={wall}", f"out={tmp_path}", f"mesh.source={source}"])
    with pytest.raises(InputError, match=r"mesh\.ply is missing"):
        viewer_of(config, "127.0.0.1", _free_port(), 15)
    write_mesh(tmp_path / "mesh.ply", trimesh.load(wall / "gt_mesh.ply", process=False))
    viewer = viewer_of(config, "127.0.0.1", _free_port(), 15)
    try:
        assert viewer._kind.options == ("colour", "depth", "normals", "mesh")
        assert hit(viewer._shown, np.zeros(3), np.array([0, 0, 1.0]))[2] == pytest.approx(2.0)
    finally:
        viewer.stop()


def test_what_is_nearer_than_the_settings_draw_is_not_drawn(wall, wall_surfels, tmp_path):
    """Surfels at 2 m, seen from 1.5 m before them; render.near_m is 0.8, then 0.2."""
    save_surfels(tmp_path / "surfels.safetensors", wall_surfels, {})
    seen = {}
    for near in (0.8, 0.2):
        config = load_config([f"scene.path={wall}", f"out={tmp_path}", f"render.near_m={near}"])
        viewer = viewer_of(config, "127.0.0.1", _free_port(), 15)
        at = SimpleNamespace(wxyz=(1.0, 0, 0, 0), position=(0, 0, 1.5), fov=1.0, aspect=1.0, image_width=64)
        drawn, found = [], []
        page = SimpleNamespace(set_background_image=lambda *_, depth, drawn=drawn, **__: drawn.append(depth))
        try:
            viewer._draw(Browser(SimpleNamespace(camera=at, scene=page), viewer_pace := Pace(15)))
            viewer._measure.value = True
            viewer._browsers[7] = Browser(None, viewer_pace)
            viewer.show_message = found.append
            viewer._clicked(SimpleNamespace(client_id=7, ray_origin=(0, 0, 1.5), ray_direction=(0, 0, 1)))
        finally:
            viewer.stop()
        seen[near] = (drawn[0].min(), found)
    assert seen[0.8][0] > 100 and seen[0.8][1] == ["Nothing was reconstructed there."]
    assert seen[0.2][0] < 1 and seen[0.2][1] == ["Now the second point."]


def test_a_photo_of_the_list_is_flown_to_and_kept_views_become_a_path(wall, wall_surfels, tmp_path, monkeypatch):
    monkeypatch.setattr(server, "PATH_SIZE", (320, 180))  # a video of 61 pictures is made
    out = tmp_path / "my run"
    config = load_config([f"scene.path={wall}", f"out='{out}'"])
    save_surfels(out / "surfels.safetensors", wall_surfels, {})
    write_mesh(out / "mesh.ply", trimesh.load(wall / "gt_mesh.ply", process=False))
    viewer = viewer_of(config, "127.0.0.1", _free_port(), 15)
    viewer.start()
    try:
        with connected(viewer) as socket_:
            send(socket_, moved_to(0.0))
            until(lambda: viewer.watched)
            (browser,) = viewer._browsers.values()
            controls = {one._impl.props.label: one for one in viewer._server.gui._gui_input_handle_from_uuid.values()}
            photos = controls["fly to photo"]
            assert len(photos.options) == 9  # eight, and none
            send(socket_, set_to(photos, "../7"))
            send(socket_, set_to(photos, photos.options[4]))
            until(lambda: photos.value == photos.options[4])
            scene = scene_of_run(config)
            camera = next(frame.camera for frame in scene.frames if frame.name == photos.options[4])
            until(lambda: np.allclose(browser.client.camera.position, camera.centre, atol=1e-6))
            send(socket_, set_to(controls["path: save"], True))
            until(lambda: "Keep two views" in viewer._message.content)
            for x in (0.0, 0.6):
                send(socket_, moved_to(x))
                until(lambda x=x: np.allclose(browser.client.camera.position, (x, 0, 0)))
                kept = viewer._message.content
                send(socket_, set_to(controls["path: keep this view"], True))
                until(lambda kept=kept: viewer._message.content != kept)
            send(socket_, set_to(controls["path: save"], True))
            until(lambda: "61 pictures" in viewer._message.content)
            assert "render 'my run' path='my run/path.json'" in viewer._message.content
            downloads = []
            browser.client.send_file_download = lambda name, data: downloads.append((name, data))
            send(socket_, set_to(controls["path: record a video"], True))
            until(lambda: downloads, seconds=60)
            assert "this picture" in controls and "mesh.ply" in controls and "mesh.glb" not in controls
    finally:
        viewer.stop()
    ((name, video),) = downloads
    assert name == "path.mp4"
    pictures = pictures_of(video, tmp_path / name)
    assert len(pictures) == 61 and pictures[0].shape == (180, 320, 3)
    red, _, blue = pictures[-1][90, 160].astype(int)
    assert blue - red > 150  # where x is 0.6, as the wall is
    frames = path_frames(PathOptions(path=str(out / "path.json")), scene)
    assert len(frames) == 61
    assert np.allclose([frames[0].camera.centre, frames[-1].camera.centre], [[0, 0, 0], [0.6, 0, 0]], atol=1e-6)
    assert np.allclose(frames[30].camera.forward, [0, 0, 1], atol=1e-6)


def test_a_box_of_the_sliders_cuts_pictures_and_measures(wall_surfels):
    with serving(wall_surfels) as viewer, connected(viewer) as socket_:
        viewer.add_crop_box(np.array([-2.0, -1.5, 2.0]), np.array([1.5, 1.5, 2.0]))
        send(socket_, moved_to(0.0))
        until(lambda: viewer.watched)
        (browser,) = viewer._browsers.values()
        until(lambda: browser.drawn and browser.drawn[-1])
        x = next(one for one in viewer._server.gui._gui_input_handle_from_uuid.values() if one._impl.props.label == "x")
        for wrong in ("wide", [1], [0.0, float("nan")], [0.0, 1.0, 2.0]):
            send(socket_, set_to(x, wrong))
        send(socket_, set_to(x, (9.0, 0.5)))  # brought between its ends, and in order
        until(lambda: tuple(x.value) == (0.5, 1.5))
        until(lambda: viewer._visible is not viewer._shown)
        assert viewer._visible.centers[:, 0].min() >= 0.5 - 1e-5
        viewer._measure.value = True
        send(socket_, clicked_along((0.0, 0.0, 1.0)))
        until(lambda: "Nothing was reconstructed there" in viewer._message.content)
        send(socket_, set_to(x, (-2.0, 1.5)))
        until(lambda: viewer._visible is viewer._shown)
        viewer.show(wall_surfels)
        assert viewer._visible is wall_surfels


FIRST_WORD = """
import builtins, os, sys
from room2dgs import cli
said = builtins.print
def heard(*words, **how):
    said(*words, sorted({"torch", "viser", "open3d", "cv2", "trimesh"} & set(sys.modules)), flush=True)
    os._exit(0)
builtins.print = heard
cli.main(["view", sys.argv[1]])
"""


def test_its_first_word_comes_before_the_libraries_that_take_seconds(wall, tmp_path):
    write_config(tmp_path, load_config([f"scene.path={wall}", f"out={tmp_path}"]))
    done = subprocess.run([sys.executable, "-c", FIRST_WORD, str(tmp_path)], capture_output=True, text=True, check=True)
    assert done.stdout == f"reading {tmp_path} []\n"
