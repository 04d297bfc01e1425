"""The server: a browser's camera in, our pictures out; meshes, seeds and cameras are drawn by the browser over them."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from room2dgs.errors import InputError, first_line
from room2dgs.geometry.camera import NEAR_M, Camera
from room2dgs.geometry.rotations import quaternions_from
from room2dgs.logs import Log
from room2dgs.primitives.primitive import Splats
from room2dgs.texts import shown
from room2dgs.viewer.door import EVERYWHERE, LOOPBACK, NAMES_OF_LOOPBACK, Door, in_url, names_of
from room2dgs.viewer.guarded_server import guarded_server
from room2dgs.viewer.messages import Fit, one_of, pair, switch, whole
from room2dgs.viewer.pace import Pace
from room2dgs.viewer.picture import KINDS, camera_at, cropped, hit, picture

if TYPE_CHECKING:
    from room2dgs.runs.page.mesh_views import DrawnMesh

Box = tuple[np.ndarray, np.ndarray]  # (3,) corners, metres
STILL_S = 0.3  # so long after its last move a camera stands: then the picture is drawn at full size
WIDEST = 1280  # pixels of a picture that stands
HIGHEST = 2 * WIDEST
FPS = 2, 30  # that a page may ask for
MOVING_QUALITY, STILL_QUALITY = 70, 90  # of the JPEGs
MESH, ERROR = "mesh", "error"
BEHIND_M, FAR_M = 0.03, 1e4  # seeds on a surface are not hidden by it; nothing is hidden where there is none
LINE_PX = 1.5  # thickness of a camera's frame
PATH_SIZE = 1280, 720  # of a path's pictures
LONGEST_NAME = 60
CROP_STEPS = 200
VIDEO = "path.mp4"
FEW = "Keep two views at least, then save the path or record it."
NOWHERE = "-"  # in the list of photos
MARK_M = 0.015  # radius of a measured point


@dataclass
class Browser:
    """One browser's window: what it wants to see, and what it was shown last.

    Attributes:
        client: viser's handle.
        moved_at: when its camera moved last, `time.monotonic`.
        drawn: what was drawn last: (number of what is shown, kind, moved, still).
        failed: a picture for it has failed, and was told.
    """

    client: Any
    pace: Pace
    moved_at: float = 0.0
    drawn: tuple = ()
    marks: list = field(default_factory=list)
    failed: bool = False


class Viewer:
    """Shows surfels, or a mesh, to every browser that connects; `start` it, and `stop` it.

    Args:
        shown: to begin with; `show` replaces it.
        up: (3,) unit, world.
        host, port: where it listens; another port if that one is taken. Another host than the loopback lets everyone
            look who reaches this machine and knows `url`. Names by which browsers may know this machine follow the
            host after commas.
        fps: wanted while a camera moves.
        near_m: `render.near_m`; surfels nearer than this are not drawn.

    Raises:
        InputError: viser is missing, nobody can be kept out of its server, or the address cannot be used.
    """

    def __init__(
        self,
        shown: Splats | DrawnMesh,
        up: np.ndarray,
        host: str = LOOPBACK,
        port: int = 8080,
        fps: float = 15.0,
        near_m: float = NEAR_M,
    ) -> None:
        viser = found_viser()
        self._shown, self._number, self._fps, self._near_m = shown, 0, fps, near_m
        self._visible: Splats | DrawnMesh = shown  # of it, what lies in the crop box
        self._box: Box | None = None
        self.host, names = names_of(host)
        self.door = Door(names)
        self._named = next((name for name in names if name not in EVERYWHERE), EVERYWHERE.get(self.host, LOOPBACK))
        self._controllable: dict[str, Fit] = {}
        self._server = guarded_server(viser, self.host, port, self.door, self._controllable)
        # viser can open a tunnel to the outside when any browser asks for it: not from here
        self._server.request_share_url = lambda *_, **__: None
        self._server.gui.configure_theme(show_share_button=False, show_logo=False)
        self._server.scene.set_up_direction(tuple(float(x) for x in up))
        self.port = self._server.get_port()
        self._browsers: dict[int, Browser] = {}
        self._drawing = threading.Lock()
        self._wake, self._ended = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._meshes: dict[str, Any] = {}
        self._server.scene.on_click()(self._clicked)
        self._server.on_client_connect(self._connected)
        self._server.on_client_disconnect(self._gone)
        self._controls()

    @property
    def address(self) -> str:
        """Where it listens, for logs: without the token."""
        return f"http://{in_url(self._named)}:{self.port}"

    @property
    def url(self) -> str:
        """Where a browser finds it; who knows it may look."""
        return f"{self.address}/?token={self.door.token}"

    @property
    def watched(self) -> bool:
        """Whether any browser is connected."""
        return bool(self._browsers)

    def start(self) -> None:
        """Draw from now on, in a thread."""
        self._thread = threading.Thread(target=self._loop, name="viewer", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread and the server; what browsers show stays as it is."""
        self._ended.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join()
        self._server.stop()

    def show(self, surfels: Splats) -> None:
        """Other surfels, from the next picture on."""
        self._shown, self._number = surfels, self._number + 1
        self._crop()
        self._wake.set()

    def show_message(self, line: str) -> None:
        """A line among the controls."""
        self._message.content = line

    def look_from(self, camera: Camera) -> None:
        """Where browsers that connect begin."""
        centre = camera.centre
        self._server.initial_camera.position = tuple(centre)
        self._server.initial_camera.look_at = tuple(centre + camera.forward)

    def add_mesh(self, name: str, vertices: np.ndarray, faces: np.ndarray, colors: np.ndarray) -> None:
        """A mesh that `name` (MESH, ERROR) in the list of pictures shows; colours (N, 3) uint8."""
        import trimesh

        from room2dgs.export.mesh_files import glb

        made = trimesh.Trimesh(vertices, faces, vertex_colors=colors, process=False)
        # without light (KHR_materials_unlit), so that it is as bright as the photos
        self._meshes[name] = self._server.scene.add_glb(f"/{name}", glb(made, np.eye(3)), visible=False)
        self._kind.options = (*KINDS, *self._meshes)

    def add_seeds(self, positions: np.ndarray, size_m: float) -> None:
        """Points (N, 3), metres."""
        points = self._server.scene.add_point_cloud(
            "/seeds",
            positions.astype(np.float32),
            (230, 120, 30),
            point_size=size_m,
            precision="float32",
            visible=False,
        )
        self._switch("seeds", [points])

    def add_cameras(
        self, names: Sequence[str], cameras: Sequence[Camera], photos: Sequence[np.ndarray], size_m: float
    ) -> None:
        """Frames of the cameras, with small photos (h, w, 3) uint8 in them; a click on one leads there, as does a
        choice of its name from a list.
        """
        bare, filled = [], []
        for index, (camera, photo) in enumerate(zip(cameras, photos, strict=True)):
            fov = 2 * np.arctan(camera.height / 2 / camera.K[1, 1])
            wxyz = quaternions_from(camera.rotation.T[None])[0]
            common = {
                "scale": size_m,
                "thickness": LINE_PX,
                "thickness_units": "screen",
                "wxyz": wxyz,
                "position": camera.centre,
                "visible": False,
            }
            aspect = camera.width / camera.height
            bare.append(self._server.scene.add_camera_frustum(f"/cameras/{index}", fov, aspect, **common))
            filled.append(self._server.scene.add_camera_frustum(f"/photos/{index}", fov, aspect, image=photo, **common))
            for handle in (bare[-1], filled[-1]):
                handle.on_click(lambda event, wxyz=wxyz, at=camera.centre: _go(event.client, wxyz, at))
        self._switch("cameras", bare)
        self._switch("photos", filled)
        self._photo_list({shown(name, LONGEST_NAME): camera for name, camera in zip(names, cameras, strict=True)})

    def _photo_list(self, cameras: dict[str, Camera]) -> None:
        chosen = self._server.gui.add_dropdown("fly to photo", (NOWHERE, *cameras), initial_value=NOWHERE)
        self._accepts(chosen, one_of(lambda: tuple(chosen.options)))

        def fly(event: Any) -> None:
            camera = cameras.get(chosen.value)
            if camera is not None and event.client is not None:
                _go(event.client, quaternions_from(camera.rotation.T[None])[0], camera.centre)

        chosen.on_update(fly)

    def add_crop_box(self, low: np.ndarray, high: np.ndarray) -> None:
        """Sliders that cut splats away outside of a box; with corners (3,) to begin with, metres."""
        sides = []
        with self._server.gui.add_folder("crop box (splats and saved meshes)", expand_by_default=False):
            for axis, least, most in zip("xyz", low.tolist(), high.tolist(), strict=True):
                step = max((most - least) / CROP_STEPS, 1e-6)
                slider = self._server.gui.add_multi_slider(axis, least, most, step, (least, most))
                self._accepts(slider, pair(least, most))
                sides.append(slider)

        def cut(_: Any) -> None:
            ends = np.array([side.value for side in sides], float)
            whole = np.allclose(ends, np.stack([low, high], axis=1), atol=1e-4)
            self._box = None if whole else (ends[:, 0], ends[:, 1])
            self._crop()
            self._again()

        for side in sides:
            side.on_update(cut)

    def _crop(self) -> None:
        self._visible = self._shown if self._box is None else cropped(self._shown, *self._box)

    def add_saving(
        self,
        files: Mapping[str, Callable[[Box | None], bytes]],
        save_path: Callable[[list[Camera]], str],
        record: Callable[[list[Camera]], bytes] | None = None,
    ) -> None:
        """Buttons that save what a browser sees, files of the run, and a path of views that were kept.

        Args:
            files: name -> its bytes, of what lies in a box if there is one; the browser saves them.
            save_path: takes two kept views or more, writes a path through them, and says where.
            record: a video of that path as MP4; None: there is nothing to draw it from.
        """
        with self._server.gui.add_folder("save", expand_by_default=False):
            self._button("this picture", self._save_picture)
            for name, read in files.items():
                self._button(name, partial(self._send, name, read))
            kept: list[Camera] = []

            def keep(client: Any) -> None:
                kept.append(camera_at(client.camera.wxyz, client.camera.position, client.camera.fov, PATH_SIZE))
                self.show_message(f"{len(kept)} views are kept for a path.")

            def forget(client: Any) -> None:
                kept.clear()
                self.show_message("No view is kept.")

            def save(client: Any) -> None:
                self.show_message(save_path(kept) if len(kept) > 1 else FEW)

            def film(client: Any) -> None:
                if len(kept) < 2 or record is None:
                    return self.show_message(FEW)
                self.show_message("Recording a video of the path; the browser saves it at the end.")
                self._send(VIDEO, lambda _: record(list(kept)), client)

            self._button("path: keep this view", keep)
            self._button("path: save", save)
            if record is not None:
                self._button("path: record a video", film)
            self._button("path: forget", forget)

    def _button(self, label: str, pressed: Callable[[Any], None]) -> None:
        button = self._server.gui.add_button(label)
        self._accepts(button, switch)
        button.on_click(lambda event: pressed(event.client) if event.client is not None else None)

    def _send(self, name: str, read: Callable[[Box | None], bytes], client: Any) -> None:
        try:
            data = read(self._box)
        except (OSError, InputError) as error:
            return self.show_message(f"{name}: {first_line(error)}")
        client.send_file_download(name, data)
        cut = " (what lies in the crop box)" if self._box is not None and name != VIDEO else ""
        self.show_message(f"{name} is saved{cut}.")

    def _save_picture(self, client: Any) -> None:
        kind = self._kind.value if self._kind.value in KINDS else KINDS[0]
        camera = client.camera
        size = full_size(max(float(camera.aspect), 0.1), WIDEST)
        with self._drawing:
            seen = picture(self._visible, camera_at(camera.wxyz, camera.position, camera.fov, size), kind, self._near_m)
        done, data = cv2.imencode(".png", seen.pixels[..., ::-1])
        if done:
            client.send_file_download("room.png", data.tobytes())

    def draw(self) -> int:
        """One picture for each browser that wants one; how many were drawn."""
        drawn = 0
        with self._drawing:
            for browser in list(self._browsers.values()):
                try:
                    drawn += self._draw(browser)
                except Exception as error:  # others go on, whatever one browser wants to see
                    self._failed(browser, error)
        return drawn

    def _failed(self, browser: Browser, error: Exception) -> None:
        if not browser.failed:
            browser.failed = True
            print(f"a picture for a browser failed ({type(error).__name__}: {first_line(error)})", file=sys.stderr)

    def _controls(self) -> None:
        gui = self._server.gui
        self._kind = gui.add_dropdown("show", KINDS, initial_value=KINDS[0])
        self._kind.on_update(lambda _: self._chosen())
        self._accepts(self._kind, one_of(lambda: tuple(self._kind.options)))
        rate = gui.add_slider("pictures a second", *FPS, 1, min(max(round(self._fps), FPS[0]), FPS[1]))
        rate.on_update(lambda _: self._paced(rate.value))
        self._accepts(rate, whole(*FPS))
        self._measure = gui.add_checkbox("measure: click two points", False)
        self._measure.on_update(lambda _: self._clear())
        self._accepts(self._measure, switch)
        self._message = gui.add_markdown("")

    def _accepts(self, control: Any, fit: Fit) -> None:
        """What browsers may set a control to; others are deaf to them."""
        self._controllable[control._impl.uuid] = fit

    def _switch(self, label: str, handles: Sequence[Any]) -> None:
        box = self._server.gui.add_checkbox(label, False)

        def switched(_: Any) -> None:
            with self._server.atomic():
                for handle in handles:
                    handle.visible = box.value
            self._again()

        box.on_update(switched)
        self._accepts(box, switch)

    def _chosen(self) -> None:
        for name, mesh in self._meshes.items():
            mesh.visible = self._kind.value == name
        self._again()

    def _again(self) -> None:
        for browser in list(self._browsers.values()):
            browser.drawn = ()
        self._wake.set()

    def _paced(self, fps: float) -> None:
        for browser in list(self._browsers.values()):
            browser.pace.fps = fps

    def _connected(self, client: Any) -> None:
        browser = Browser(client, Pace(self._fps), time.monotonic())
        self._browsers[client.client_id] = browser

        def camera_moved(_: Any) -> None:
            browser.moved_at = time.monotonic()
            self._wake.set()

        client.camera.on_update(camera_moved)
        self._wake.set()

    def _gone(self, client: Any) -> None:
        self._browsers.pop(client.client_id, None)

    def _loop(self) -> None:
        while not self._ended.is_set():
            self._wake.wait(STILL_S / 2)
            self._wake.clear()
            while not self._ended.is_set() and self.draw():
                pass

    def _draw(self, browser: Browser) -> bool:
        kind, moved_at, number = self._kind.value, browser.moved_at, self._number
        still = time.monotonic() - moved_at > STILL_S
        if browser.drawn == (number, kind, moved_at, still):
            return False
        browser.drawn = (number, kind, moved_at, still)
        scene = browser.client.scene
        if kind not in KINDS:  # the browser draws it
            scene.set_background_image(None)
            return False
        camera = browser.client.camera
        widest = min(camera.image_width or WIDEST, WIDEST)
        aspect = max(float(camera.aspect), 0.1)
        size = full_size(aspect, widest) if still else browser.pace.size(aspect, widest)
        start = time.perf_counter()
        seen = picture(self._visible, camera_at(camera.wxyz, camera.position, camera.fov, size), kind, self._near_m)
        browser.pace.took(size, time.perf_counter() - start)
        # what the browser draws is hidden behind surfaces by their depth; it costs more to send than the picture
        depth = np.where(seen.depth > 0, seen.depth + BEHIND_M, FAR_M)[..., None] if still else None
        quality = STILL_QUALITY if still else MOVING_QUALITY
        scene.set_background_image(seen.pixels, format="jpeg", jpeg_quality=quality, depth=depth)
        return True

    def _clicked(self, event: Any) -> None:
        browser = self._browsers.get(event.client_id)
        if browser is None or not self._measure.value:
            return
        point = hit(self._visible, np.array(event.ray_origin), np.array(event.ray_direction), self._near_m)
        if point is None:
            self.show_message("Nothing was reconstructed there.")
            return
        if len(browser.marks) >= 2:
            self._clear()
        browser.marks.append(point)
        self.show_message("Now the second point.")
        scene = self._server.scene
        index = len(browser.marks)
        scene.add_icosphere(f"/measured/{index}", radius=MARK_M, color=(194, 24, 91), position=tuple(point))
        if index == 2:
            one, other = browser.marks
            text = distance_text(one, other)
            scene.add_line_segments("/measured/line", np.stack([one, other])[None], (194, 24, 91), thickness=MARK_M / 2)
            scene.add_label("/measured/text", text, position=tuple((one + other) / 2))
            self.show_message(f"Distance: {text}")

    def _clear(self) -> None:
        for browser in list(self._browsers.values()):
            browser.marks.clear()
        for name in ("1", "2", "line", "text"):
            self._server.scene.remove_by_name(f"/measured/{name}")
        self.show_message("")


def found_viser() -> Any:
    """The module.

    Raises:
        InputError: it is missing.
    """
    try:
        import viser
    except ImportError as error:
        raise InputError("viser is missing; install it with: pip install 'room2dgs[view]'") from error
    return viser


def full_size(aspect: float, widest: int) -> tuple[int, int]:
    """(width, height) of a picture as wide as a window, if it does not become too high."""
    height = max(1, round(widest / aspect))
    return (widest, height) if height <= HIGHEST else (max(1, round(HIGHEST * aspect)), HIGHEST)


def distance_text(one: np.ndarray, other: np.ndarray) -> str:
    """Between two points in metres, to the millimetre."""
    return f"{np.linalg.norm(np.asarray(other) - np.asarray(one)):.3f} m"


def warn_of_host(host: str, log: Log) -> None:
    """Says so where others can look."""
    address, _ = names_of(host)
    if address not in NAMES_OF_LOOPBACK:
        log(
            f"WARNING: everyone who reaches this machine at {address} and knows the token can look, and the connection "
            "is not encrypted; leave host= out for this machine alone"
        )


def _go(client: Any, wxyz: np.ndarray, position: np.ndarray) -> None:
    with client.atomic():
        client.camera.wxyz = wxyz
        client.camera.position = position
