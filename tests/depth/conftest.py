"""A box room drawn by ray casting, and priors of it on disk."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import onnx
import pytest

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.config import load_config
from room2dgs.depth.align.scale_shift import Fit
from room2dgs.depth.completion.stages import reduce_resolution
from room2dgs.depth.joint import optimise as joint
from room2dgs.depth.sources.source import Proposal
from room2dgs.depth.stages import STAGES
from room2dgs.depth.state import DepthSettings, first_state
from room2dgs.geometry.camera import Camera
from tests.depth.cards import write_card

FEWER = 5  # times fewer steps of the joint optimisation than a run takes: these rooms are small


@pytest.fixture(autouse=True)
def few_steps(request, monkeypatch):
    """All its stages, in few steps; slow tests take them as they are."""
    if not request.node.get_closest_marker("slow"):
        stages = tuple(stage._replace(steps=stage.steps // FEWER) for stage in joint.STAGES)
        monkeypatch.setattr(joint, "STAGES", stages)


WIDTH, HEIGHT = 80, 60
ROOM = np.array([4.0, 5.0, 2.6])  # metres, one corner at the origin


@dataclass
class Room:
    """Frames inside a box, their exact depth (m) and normals (camera frame, facing it), and points on the walls."""

    frames: list[Frame]
    depths: list[np.ndarray]
    normals: list[np.ndarray]
    points: PointCloud


def camera_at(eye: np.ndarray, yaw: float, pitch: float) -> Camera:
    forward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    cam_from_world = np.eye(4)
    cam_from_world[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    cam_from_world[:3, 3] = -cam_from_world[:3, :3] @ eye
    K = np.array([[60.0, 0, 40.5], [0, 61.0, 29.0], [0, 0, 1.0]])
    return Camera(K, WIDTH, HEIGHT, cam_from_world)


def cast(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Exact z-depth and camera-frame normals of the box."""
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    K = camera.K
    rays = np.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1], np.ones_like(x)], axis=-1)
    in_world = rays @ camera.cam_from_world[:3, :3]
    with np.errstate(divide="ignore"):
        distance = (np.where(in_world > 0, ROOM, 0.0) - camera.centre) / in_world
    wall = distance.argmin(axis=-1)
    normal = np.zeros_like(rays)
    sign = -np.sign(np.take_along_axis(in_world, wall[..., None], axis=-1))
    np.put_along_axis(normal, wall[..., None], sign, axis=-1)
    return distance.min(axis=-1), normal @ camera.cam_from_world[:3, :3].T


def room_seen_from(count: int, turn: float, photos: Path) -> Room:
    """`count` views, each turned by `turn` radians from the one before; in the folder photos without an edge."""
    frames, depths, normals, xyz = [], [], [], []
    rng = np.random.default_rng(0)
    for i in range(count):
        camera = camera_at(np.array([1.5 + 1.0 / (count - 1) * i, 2.0, 1.4]), yaw=0.4 + turn * i, pitch=-0.25)
        depth, normal = cast(camera)
        frames.append(Frame(f"{3 * i:06d}", camera, photos / f"{3 * i}.jpg"))
        cv2.imwrite(str(frames[-1].color_path), np.full((HEIGHT, WIDTH, 3), 128, np.uint8))
        depths.append(depth)
        normals.append(normal)
        row, column = rng.integers(0, HEIGHT, 60), rng.integers(0, WIDTH, 60)
        K = camera.K
        rays = np.stack([(column + 0.5 - K[0, 2]) / K[0, 0], (row + 0.5 - K[1, 2]) / K[1, 1], np.ones(60)], axis=-1)
        in_cam = rays * depth[row, column][:, None]
        xyz.append(in_cam @ camera.cam_from_world[:3, :3] + camera.centre)
    xyz = np.concatenate(xyz)
    points = PointCloud(xyz, np.zeros((len(xyz), 3), np.uint8))
    return Room(frames, depths, normals, points)


@pytest.fixture(scope="session")
def room(tmp_path_factory) -> Room:
    return room_seen_from(6, turn=0.8, photos=tmp_path_factory.mktemp("color"))


@pytest.fixture(scope="session")
def box_room(tmp_path_factory):
    """`box_room(count, turn)`."""
    return partial(room_seen_from, photos=tmp_path_factory.mktemp("color"))


@pytest.fixture
def prior_config(tmp_path_factory):
    """`prior_config(**settings)`: dotted prior settings with the dots written as two underscores.

    `depth__card__white=255` changes the card of the network: room_prior's, or one that says nothing.
    """

    def make(*choice: str, **changes):
        for kind in ("depth", "normal"):
            mark = f"{kind}__card__"
            card = {key.removeprefix(mark): changes.pop(key) for key in list(changes) if key.startswith(mark)}
            if card or f"prior/{kind}=onnx" in choice:
                path = tmp_path_factory.mktemp("cards") / f"{kind}.json"
                base = "room_prior" if "prior=room_prior" in choice else None
                changes[f"{kind}__card"] = write_card(path, kind, card, base)
        overrides = [f"prior.{key.replace('__', '.')}={value}" for key, value in changes.items()]
        whole = [] if any(part.startswith("prior=") for part in choice) else ["prior=none"]
        return load_config(["scene.path=a", "out=b", *whole, *choice, *overrides]).prior

    return make


def png8(normal: np.ndarray) -> np.ndarray:
    """BGR bytes as cv2 writes them."""
    return np.round((normal + 1.0) * 127.5).astype(np.uint8)[..., ::-1]


class ExactMaps(dict):
    """Maps that are kept as they are; those of a run are rounded."""

    put = dict.__setitem__


@pytest.fixture
def complete_views(prior_config):
    """`complete_views(frames, depths, normals, points, ...)` runs completion's stages alone.

    Gives frame name -> (H, W) depth and weight. residuals: of each view's prior at the points. settings: of
    `prior.depth`.
    """

    def run(frames, depths, normals, points, *, stereo=None, residuals=None, space=None, correct=None, **settings):
        config = prior_config(**{f"depth__{key}": value for key, value in {"joint": True, **settings}.items()})
        fits = {name: Fit(1.0, 0.0, residual, 100) for name, residual in (residuals or {}).items()}
        state = replace(
            first_state(frames, points), proposal=Proposal(config), maps=ExactMaps(), stereo=stereo or {}, fits=fits,
            free_space=space, depths=depths, normals=normals,
        )  # fmt: skip
        for stage in STAGES[STAGES.index(reduce_resolution) :]:
            state = stage(state, DepthSettings(config, correct=correct, log=lambda line: None))
        return {name: (maps.depth, maps.depth_confidence) for name, maps in state.maps.items()}

    return run


@pytest.fixture
def map_files(tmp_path: Path, room: Room):
    """`map_files(depth=f, normal=g)` writes every frame's maps, changed by f(depth, i) and g(normal, i), and
    gives their folder."""

    def write(depth=lambda depth, i: depth, normal=lambda normal, i: normal) -> Path:
        (tmp_path / "depth").mkdir()
        (tmp_path / "normal").mkdir()
        for i, frame in enumerate(room.frames):
            np.save(tmp_path / "depth" / f"{frame.color_path.stem}.npy", depth(room.depths[i], i).astype(np.float32))
            cv2.imwrite(str(tmp_path / "normal" / f"{frame.name}.png"), png8(normal(room.normals[i], i)))
        return tmp_path

    return write


@pytest.fixture
def onnx_file(tmp_path: Path):
    """`onnx_file(nodes, ...)` writes a network of the given nodes and gives its path.

    nodes: (operator, inputs, outputs, attributes) each. inputs, outputs: name -> (element type, shape), a
    shape's text being a side of any size. constants: name -> array. name: of the file.
    """

    def write(nodes, inputs=None, outputs=None, constants=None, name="model.onnx") -> Path:
        photo = {"photo": ("FLOAT", (1, 3, "h", "w"))}
        graph = onnx.helper.make_graph(
            [onnx.helper.make_node(kind, source, target, **attributes) for kind, source, target, attributes in nodes],
            "test",
            *(
                [
                    onnx.helper.make_tensor_value_info(key, getattr(onnx.TensorProto, kind), shape)
                    for key, (kind, shape) in (given or photo).items()
                ]
                for given in (inputs, outputs or {"map": ("FLOAT", None)})
            ),
            [onnx.numpy_helper.from_array(np.asarray(value), key) for key, value in (constants or {}).items()],
        )
        model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)
        onnx.save(model, str(tmp_path / name))
        return tmp_path / name

    return write


@pytest.fixture
def depth_network(onnx_file) -> Path:
    """Its map is the mean of the photo's channels."""
    return onnx_file([("ReduceMean", ["photo"], ["map"], {"axes": [1], "keepdims": 1})], name="mean.onnx")


NEAREST = 0.5  # metres; the nearest depth that `coded_photo` encodes


def coded_photo(depth: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 that `room_network` reads depth and camera-frame normals from: (inverse depth, n_x, n_y)."""
    channels = [NEAREST / depth, 0.5 * (normal[..., 0] + 1), 0.5 * (normal[..., 1] + 1)]
    return np.round(255 * np.stack(channels, axis=-1).clip(0, 1)).astype(np.uint8)


@pytest.fixture
def coded_photos(room, photos) -> list[Frame]:
    """Frames of the room whose photos say what `room_network` has to find."""
    return photos([coded_photo(depth, normal) for depth, normal in zip(room.depths, room.normals, strict=True)])


@pytest.fixture
def room_network(onnx_file) -> Path:
    """A network with the inputs and outputs of the one that is shipped; it reads its maps off `coded_photo`.

    Its metres are those of a camera whose input has fx = fy = 240. Expected errors: of ln depth 0.3 beyond 2.5 m and
    0.02 nearer; of normals 0.1 everywhere.
    """
    sides = ("height", "width")
    nodes = [
        ("Split", ["image"], ["inverse", "g", "b"], {"axis": 1}),
        ("Div", ["nearest", "inverse"], ["canonical"], {}),
        ("Slice", ["intrinsics", "zero", "one", "axes"], ["row"], {}),
        ("Slice", ["row", "zero", "one", "last"], ["fx"], {}),
        ("Div", ["fx", "focal"], ["factor3"], {}),
        ("Unsqueeze", ["factor3", "last"], ["factor"], {}),
        ("Mul", ["canonical", "factor"], ["depth"], {}),
        ("Greater", ["canonical", "far"], ["is_far"], {}),
        ("Where", ["is_far", "unsure", "sure"], ["depth_error"], {}),
        ("Mul", ["g", "two"], ["g2"], {}),
        ("Sub", ["g2", "one_f"], ["nx"], {}),
        ("Mul", ["b", "two"], ["b2"], {}),
        ("Sub", ["b2", "one_f"], ["ny"], {}),
        ("Mul", ["nx", "nx"], ["nx2"], {}),
        ("Mul", ["ny", "ny"], ["ny2"], {}),
        ("Sum", ["nx2", "ny2"], ["across"], {}),
        ("Sub", ["one_f", "across"], ["rest"], {}),
        ("Max", ["rest", "tiny"], ["nz2"], {}),
        ("Sqrt", ["nz2"], ["minus_nz"], {}),
        ("Neg", ["minus_nz"], ["nz"], {}),
        ("Concat", ["nx", "ny", "nz"], ["rough"], {"axis": 1}),
        ("LpNormalization", ["rough"], ["normal"], {"axis": 1, "p": 2}),
        ("Mul", ["nx", "zero_f"], ["nought"], {}),
        ("Add", ["nought", "tenth"], ["normal_error"], {}),
    ]
    numbers = {"nearest": NEAREST, "far": 2.5, "unsure": 0.3, "sure": 0.02, "two": 2.0, "one_f": 1.0, "tiny": 1e-6}
    numbers |= {"focal": 240.0, "zero_f": 0.0, "tenth": 0.1}
    constants = {name: np.float32(value) for name, value in numbers.items()}
    constants |= {name: np.array([value], np.int64) for name, value in dict(zero=0, one=1, axes=1, last=2).items()}
    channels = {"depth": 1, "depth_error": 1, "normal": 3, "normal_error": 1}
    return onnx_file(
        nodes,
        {"image": ("FLOAT", (1, 3, *sides)), "intrinsics": ("FLOAT", (1, 3, 3))},
        {name: ("FLOAT", (1, count, *sides)) for name, count in channels.items()},
        constants,
        name="stand_in.onnx",
    )


@pytest.fixture
def photos(tmp_path: Path, room: Room):
    """`photos(images)` writes an (H, W, 3) uint8 RGB photo for each frame of the room and gives the frames."""

    def write(images) -> list[Frame]:
        (tmp_path / "color").mkdir(exist_ok=True)
        frames = [replace(frame, color_path=tmp_path / "color" / f"{frame.name}.png") for frame in room.frames]
        for frame, image in zip(frames, images, strict=True):
            cv2.imwrite(str(frame.color_path), image[..., ::-1])
        return frames

    return write
