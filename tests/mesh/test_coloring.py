"""Colours of a surface from photos of a made room: a patterned wall with a plate before it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs import _C
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.scene import Frame
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.coloring.best import Levels, Points, Views, best_colors, softened
from room2dgs.mesh.coloring.drawn import Surface, drawn
from room2dgs.mesh.coloring.levels import view_offsets
from room2dgs.mesh.coloring.spread import spread_colors
from room2dgs.mesh.coloring.vertices import photo_colored, vertex_points
from room2dgs.mesh.open3d import o3c_tensor, o3d

SIZE = (200, 150)
K = np.array([[170.0, 0, 100], [0, 170, 75], [0, 0, 1]])
WALL_M, CHECK_M, GRID_M = 2.0, 0.12, 0.02
PLATE = np.array([255.0, 0, 255])


def grid(width: float, height: float, z: float, side: float, at=(0.0, 0.0)) -> trimesh.Trimesh:
    """A flat piece across the z axis that faces the cameras, which look along it."""
    x = np.linspace(-width / 2, width / 2, round(width / side) + 1) + at[0]
    y = np.linspace(-height / 2, height / 2, round(height / side) + 1) + at[1]
    xs, ys = np.meshgrid(x, y)
    index = np.arange(xs.size).reshape(xs.shape)
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel()
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])
    return trimesh.Trimesh(np.column_stack([xs.ravel(), ys.ravel(), np.full(xs.size, z)]), faces, process=False)


def paint(points: np.ndarray) -> np.ndarray:
    """Checks on the wall, lighter to the right; the plate is magenta."""
    check = np.floor(points[..., 0] / CHECK_M) + np.floor(points[..., 1] / CHECK_M)
    light = np.where(check % 2 == 0, 60.0, 150.0) + 20 * points[..., 0]
    wall = np.stack([light, 0.8 * light, 1.1 * light], axis=-1)
    return np.where((points[..., 2] < WALL_M - 0.1)[..., None], PLATE, wall)


def camera_at(x: float, y: float, z: float = 0.0) -> Camera:
    pose = np.eye(4)
    pose[:3, 3] = (-x, -y, -z)
    return Camera(K, *SIZE, pose)


def photo_of(surface: Surface, camera: Camera) -> np.ndarray:
    """Without noise, nine rays a pixel."""
    fine = camera.resized(3 * camera.width, 3 * camera.height)
    picture = paint(fine.unproject_map(surface.seen_by(fine).depth.astype(float)))
    return cv2.resize(picture, camera.size, interpolation=cv2.INTER_AREA)


@pytest.fixture(scope="module")
def room() -> trimesh.Trimesh:
    return trimesh.util.concatenate([grid(2.0, 1.4, WALL_M, GRID_M), grid(0.4, 0.4, 1.3, GRID_M)])


@pytest.fixture(scope="module")
def shots(room, tmp_path_factory):
    """Photos from left to right; one that is 1.3 times as bright, and one that is blurred."""
    folder = tmp_path_factory.mktemp("shots")
    surface, frames = Surface(room), []
    for number, x in enumerate(np.linspace(-0.6, 0.6, 7)):
        camera = camera_at(x, 0.1 * (-1) ** number, 0.2 if number == 3 else 0.0)
        photo = photo_of(surface, camera) * (1.3 if number == 2 else 1.0)
        if number == 3:  # the nearest
            photo = cv2.GaussianBlur(photo, (0, 0), 4)
        path = folder / f"{number}.png"
        cv2.imwrite(str(path), photo.clip(0, 255).round().astype(np.uint8)[..., ::-1])
        frames.append(Frame(str(number), camera, path, index=number))
    return frames


@pytest.fixture(scope="module")
def colored(room, shots):
    mesh, share = photo_colored(room, shots)
    return mesh.vertices, np.asarray(mesh.visual.vertex_colors)[:, :3].astype(float), share


def on_wall(points: np.ndarray) -> np.ndarray:
    """On the wall, away from its ends, beyond which photos show nothing."""
    return (points[:, 2] > 1.9) & (np.abs(points[:, :2]) < (0.9, 0.6)).all(axis=1)


def inside_checks(points: np.ndarray, margin_m: float) -> np.ndarray:
    """Those at least so far from the checks' borders."""
    place = points[:, :2] / CHECK_M
    return (np.abs(place - np.round(place)) * CHECK_M > margin_m).all(axis=1)


def test_checks_come_back_sharp_and_of_one_exposure(colored):
    """The nearest photo is blurred and another too bright: neither shows, though a mean would show both."""
    points, colors, share = colored
    wall = on_wall(points) & inside_checks(points, 0.03)
    ratio = colors[wall] / paint(points[wall])
    assert (np.abs(ratio / np.median(ratio) - 1) > 0.08).mean() < 0.01
    assert share > 0.9
    light = paint(points)[:, 0] > 105
    steps = np.median(colors[wall & light, 0]) - np.median(colors[wall & ~light, 0])
    assert steps > 0.97 * 90 * np.median(ratio)


def test_what_is_before_the_wall_does_not_colour_it_nor_the_wall_it(colored):
    points, colors, _ = colored
    magenta = np.minimum(colors[:, 0], colors[:, 2]) - colors[:, 1]
    plate = points[:, 2] < 1.4
    assert magenta[on_wall(points)].max() < 36 + 15  # the wall itself has 36, the plate 255
    inner = plate & (np.abs(points[:, :2]) < 0.17).all(axis=1)
    assert magenta[inner].min() > 200


def test_the_same_bits_on_one_and_two_threads_and_twice(room, shots):
    results = []
    before = _C.threads()
    try:
        for count in (1, 2, 2):
            _C.set_threads(count)
            results.append(np.asarray(photo_colored(room, shots)[0].visual.vertex_colors).tobytes())
    finally:
        _C.set_threads(before)
    assert results[0] == results[1] == results[2]


def test_a_mask_hides_what_may_not_be_used(room, shots, tmp_path):
    """Of a photo whose right half is masked, the left half alone is asked."""
    mask = np.full(SIZE[::-1], 255, np.uint8)
    mask[:, SIZE[0] // 2 :] = 0
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    frame = replace(shots[0], mask_photo=PhotoFile(tmp_path / "mask.png"))
    _, known = best_colors(vertex_points(room), Surface(room), [frame], Levels.alike(1))
    x = frame.camera.project(room.vertices[known])[0][:, 0]
    assert known.any() and x.max() < SIZE[0] / 2 + 1


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), behind=st.booleans())
def test_drawing_is_ray_casting(seed, behind):
    """Against open3d's rays, also with faces that reach behind the camera and degenerate ones."""
    random = np.random.default_rng(seed)
    vertices = random.uniform((-2, -2, -1 if behind else 0.3), (2, 2, 3), (30, 3)).astype(np.float32)
    faces = random.integers(0, 30, (20, 3)).astype(np.int32)
    camera = Camera(np.array([[20.0, 0, 15.3], [0, 22, 11.8], [0, 0, 1]]), 31, 23, np.eye(4))
    found = drawn(vertices, faces, camera.K, camera.size)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3c_tensor(vertices), o3c_tensor(faces.astype(np.uint32)))
    near = 0.05 * camera.rays()
    rays = np.concatenate([near, camera.rays()], axis=-1).astype(np.float32)  # from the near plane on
    answer = scene.cast_rays(o3c_tensor(rays))["t_hit"].numpy() + 0.05
    same = np.isclose(np.where(found.depth > 0, found.depth, np.inf), answer, rtol=1e-3)
    assert (~same).sum() <= 3  # rays through edges
    assert ((found.face >= 0) == (found.depth > 0)).all()


def test_faces_that_share_an_edge_leave_no_gap():
    """A fan whose edges run through pixels' centres covers each pixel."""
    angle = np.linspace(0, 2 * np.pi, 9)[:-1]
    rim = np.stack([40 * np.cos(angle), 40 * np.sin(angle), np.full(8, 1.0)], axis=1)
    vertices = np.concatenate([[[0, 0, 1]], rim]).astype(np.float32)
    faces = np.array([(0, 1 + k, 1 + (k + 1) % 8) for k in range(8)], np.int32)
    found = drawn(vertices, faces, np.array([[10.0, 0, 10.5], [0, 10, 10.5], [0, 0, 1]]), (21, 21))
    assert (found.face >= 0).all() and np.allclose(found.depth, 1)


def reference(room, frame):
    """Place and quality of a view's points in float64, hidden or not, without what silhouettes and rims take off."""
    points = vertex_points(room)
    camera = frame.camera
    pixel, z = camera.project(points.places.astype(float))
    ray = points.places - camera.centre
    cosine = -(points.normals * ray).sum(1) / np.linalg.norm(ray, axis=1)
    return pixel, cosine * camera.K[0, 0] / z


def test_one_view_is_what_float64_says(room, shots):
    frame, surface = shots[5], Surface(room)
    photo, depth = frame.color(), surface.seen_by(frame.camera).depth
    points = vertex_points(room)
    points = Points(*points[:2], np.zeros(len(room.vertices), np.float32))
    views = Views(points)
    views.look(frame, depth, photo, softened(photo), np.array([1.0, 1.0, 1.0]))
    pixel, quality = reference(room, frame)
    middle = (np.abs(pixel - 0.5 * np.array(SIZE)) < 0.4 * np.array(SIZE)).all(axis=1)
    clear = middle & (views.quality[:, 0] > 0.9 * quality)
    assert clear.sum() > 1000
    np.testing.assert_allclose(views.quality[clear, 0], quality[clear], rtol=1e-4)
    x, y = (pixel[clear] - 0.5).astype(np.float32).T
    wanted = cv2.remap(photo.astype(np.float32), x[:, None], y[:, None], cv2.INTER_LINEAR)[:, 0]
    assert np.abs(views.sharp[clear, 0] - wanted).max() < 6  # remap's own places are of 1/32 pixel
    assert (views.quality[:, 1:] == 0).all()


def test_offsets_of_views_are_found_beside_gross_errors():
    random = np.random.default_rng(0)
    truth = random.normal(0, 0.3, 12)
    truth -= truth.mean()
    own = random.normal(0, 1, 900)
    seen = random.random((12, 900)) < 0.4
    view, point = np.nonzero(seen)
    values = truth[view] + own[point] + random.normal(0, 0.02, len(view))
    wrong = random.random(len(view)) < 0.15
    values[wrong] += random.uniform(0.5, 2, wrong.sum())
    assert np.abs(view_offsets(view, point, values, seen.shape, 0.1) - truth).max() < 0.05


def test_unknown_vertices_take_what_is_around_them_and_lone_pieces_stay():
    strip = grid(1.0, 0.2, 0.0, 0.1)
    x = np.asarray(strip.vertices)[:, 0]
    faces = np.concatenate([np.asarray(strip.faces), [[len(x), len(x) + 1, len(x) + 2]]])
    colors = np.concatenate([np.where(x < -0.4, 100.0, 200.0), [7.0, 8, 9]])[:, None]
    known = np.concatenate([np.abs(x) > 0.4, np.zeros(3, bool)])
    found = spread_colors(colors, known, faces)[:, 0]
    assert (found[known] == colors[known, 0]).all() and found[-3:].tolist() == [7, 8, 9]
    across = [found[:-3][np.isclose(x, value)].mean() for value in (-0.4, -0.2, 0.0, 0.2, 0.4)]
    assert (
        across == sorted(across) and across[0] >= 100 and across[-1] <= 200 and across[2] == pytest.approx(150, abs=12)
    )


@pytest.mark.parametrize(
    "change, error, words",
    [
        ({"faces": np.array([[0, 1, 9]], np.int32)}, ValueError, "not there"),
        ({"faces": np.array([[0, 1, -1]], np.int32)}, ValueError, "not there"),
        ({"faces": np.array([[0, 1, 2]])}, TypeError, "faces"),
        ({"fx": 0.0}, ValueError, "above 0"),
        ({"near": np.nan}, ValueError, "near"),
        ({"face": np.zeros((4, 6), np.int32)}, ValueError, "shape"),
    ],
)
def test_what_cannot_be_drawn_is_refused(change, error, words):
    arguments = {
        "vertices": np.eye(3, dtype=np.float32), "faces": np.array([[0, 1, 2]], np.int32), "fx": 5.0, "fy": 5.0,
        "cx": 2.0, "cy": 2.0, "near": 0.05, "depth": np.zeros((4, 5), np.float32), "face": np.zeros((4, 5), np.int32),
    }  # fmt: skip
    _C.draw_faces(**arguments)
    with pytest.raises(error, match=words):
        _C.draw_faces(**{**arguments, **change})


@pytest.mark.parametrize("name", ["photo", "gain", "sharp", "usable", "cam_from_world"])
def test_what_cannot_be_looked_up_is_refused(name):
    arguments = {
        "points": np.zeros((2, 3), np.float32), "normals": np.zeros((2, 3), np.float32),
        "spacing": np.zeros(2, np.float32), "depth": np.zeros((3, 4), np.float32),
        "photo": np.zeros((6, 8, 3), np.uint8), "soft": np.zeros((2, 2, 3), np.uint8),
        "usable": np.zeros((6, 8), np.uint8), "fx": 5.0, "fy": 5.0, "cx": 2.0, "cy": 2.0,
        "cam_from_world": np.eye(4)[:3].copy(), "gain": np.ones(3, np.float32), "sharpness": 1.0,
        "softness": 2.0, "quality": np.zeros((2, 5), np.float32), "sharp": np.zeros((2, 5, 3), np.uint8),
        "low": np.zeros((2, 5, 3), np.uint8),
    }  # fmt: skip
    _C.look_up(**arguments)
    with pytest.raises(ValueError, match="has shape"):
        _C.look_up(**{**arguments, name: arguments[name][:-1]})
