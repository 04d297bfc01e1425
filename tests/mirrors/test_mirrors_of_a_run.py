"""mirrors.json there and back, the page's picture, and a run's views and small maps with the glass in them."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.captures.read import read_scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.mesh.views import FusedView
from room2dgs.mirrors.mirror import Mirror
from room2dgs.pipeline import mirrors as pipeline
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.mirrors import read_mirrors, scaled_mirrors, trusted_depths, write_mirrors
from room2dgs.runs.page.mirrors import mirror_figures, mirror_photo
from room2dgs.runs.trust import read_trust, write_trust
from tests.mirrors.made import looking

ORIGIN = (0.0, 0.0, 0.0)
CAMERA = looking(np.array([1.9, 2.0, 1.4]), np.array([1.9, 0.0, 1.4]), (64, 48))
MIRROR = Mirror(np.array([[2.6, 0, 0.9], [1.2, 0, 0.9], [1.2, 0, 2.0], [2.6, 0, 2.0]]), 5)


def rectangle(seed: int) -> Mirror:
    random = np.random.default_rng(seed)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    wide, high = random.uniform(0.3, 2.0, 2)
    flat = np.array([[0, 0, 0], [wide, 0, 0], [wide, high, 0], [0, high, 0]])
    return Mirror(flat @ turn.T + random.normal(size=3), int(random.integers(4, 60)))


@settings(max_examples=25)
@given(st.lists(st.integers(0, 10_000), min_size=1, max_size=4), st.sampled_from([ORIGIN, (5e5, -4e6, 300.0)]))
def test_they_come_back_wherever_the_world_begins(tmp_path_factory, seeds, origin):
    path, given_ones = tmp_path_factory.mktemp("mirrors") / "mirrors.json", [rectangle(seed) for seed in seeds]
    write_mirrors(path, given_ones, origin)
    for one, other in zip(read_mirrors(path, origin), given_ones, strict=True):
        np.testing.assert_allclose(one.corners, other.corners, atol=1e-8)
        assert one.photos == other.photos


def test_no_file_is_no_mirror(tmp_path):
    assert read_mirrors(tmp_path / "mirrors.json", ORIGIN) == []


@pytest.mark.parametrize(
    "content",
    [
        {},
        {"mirrors": 3},
        {"mirrors": [{"photos": 3}]},
        {"mirrors": [{"corners_m": [[0, 0, 0]], "photos": 3}]},
        {"mirrors": [{"corners_m": [["a"] * 3] * 4, "photos": 3}]},
        {"mirrors": [{"corners_m": [[0, 0, 0]] * 4, "photos": 3}]},
        {"mirrors": [{"corners_m": [[0, 0, 0], [1, 0, 0], [2, 1, 0], [0, 1, 0]], "photos": 3}]},
    ],
)
def test_what_is_no_list_of_rectangles_is_refused_by_name(tmp_path, content):
    path = tmp_path / "mirrors.json"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"mirrors\.json .*mesh the run again"):
        read_mirrors(path, ORIGIN)


def test_they_follow_the_scale(tmp_path):
    write_mirrors(tmp_path / "mirrors.json", [MIRROR], ORIGIN)
    found = scaled_mirrors(tmp_path / "mirrors.json", 2.0)
    (tmp_path / "mirrors.json").write_text(json.dumps(found))
    (again,) = read_mirrors(tmp_path / "mirrors.json", ORIGIN)
    np.testing.assert_allclose(again.corners, 2 * MIRROR.corners)
    assert found["mirrors"][0]["width_m"] == pytest.approx(2.8)


@pytest.mark.parametrize("tensors", [False, True])
def test_a_view_has_the_glass_and_its_normal_in_place_of_the_room_behind(tensors):
    depth, normal = np.full((48, 64), 5.0, np.float32), np.tile(np.float32([1, 0, 0]), (48, 64, 1))
    depth[:4] = 0
    color = np.zeros((48, 64, 3), np.uint8)
    kind = torch.from_numpy if tensors else np.asarray
    given_view = FusedView(CAMERA, kind(depth), kind(color), normal=kind(normal))
    view = pipeline.with_glass(given_view, [MIRROR])
    assert isinstance(view.depth, torch.Tensor) == tensors
    found, glass = np.asarray(view.depth), MIRROR.glass(CAMERA) > 0
    assert glass.any() and not glass.all()
    np.testing.assert_allclose(found[glass], 2.0, rtol=1e-6)
    np.testing.assert_array_equal(found[~glass], depth[~glass])
    np.testing.assert_allclose(np.asarray(view.normal)[glass], [[0, 1, 0]] * glass.sum(), atol=1e-6)
    np.testing.assert_array_equal(np.asarray(view.normal)[~glass], normal[~glass])
    assert (np.asarray(given_view.depth) == depth).all()


def test_the_page_shows_the_photo_that_has_most_of_it():
    away = looking(np.array([1.9, 2.0, 1.4]), np.array([1.9, 4.0, 1.4]), (64, 48))
    frames = [
        SimpleNamespace(camera=camera, color=lambda: np.full((48, 64, 3), 128, np.uint8)) for camera in (away, CAMERA)
    ]
    picture = mirror_photo(MIRROR, frames)
    inside = MIRROR.glass(CAMERA.resized_to_width(picture.shape[1])) > 0
    red = picture[..., 0] - picture[..., 2]
    assert red[inside].min() > 0.1 and np.median(red[~inside]) == 0
    (figure,) = mirror_figures([MIRROR], frames, "m")
    assert "1.4 × 1.1 m" in figure.caption and "mesh.glass=keep" in figure.caption
    assert mirror_figures([], frames, "m") == []


@pytest.fixture
def run(wall, tmp_path):
    """A run whose views see a wall at z = 2 from before it, with a depth of 5 m everywhere."""
    config = load_config([f"scene.path={wall}", f"out={tmp_path}"])
    scene = read_scene(config.scene)
    maps = {
        frame.name: ViewMaps(depth=np.full((frame.camera.height, frame.camera.width), 5.0, np.float32))
        for frame in scene.train
    }
    write_trust(tmp_path / "trust.npz", scene.train, maps, {})
    return SimpleNamespace(config=config, scene=scene, out=tmp_path)


def mirror_before(camera) -> Mirror:
    """A small one, 1 m before a camera."""
    corners = np.array([[-0.2, -0.2, 1], [0.2, -0.2, 1], [0.2, 0.2, 1], [-0.2, 0.2, 1]])[::-1]
    return Mirror(corners @ camera.world_from_cam[:3, :3].T + camera.centre, 4)


def test_small_maps_have_the_glass_in_place_of_what_mirrors_show(run):
    frame = run.scene.train[0]
    write_mirrors(run.out / "mirrors.json", [mirror_before(frame.camera)], run.scene.origin_m)
    raw, found = read_trust(run.out / "trust.npz")[frame.name], trusted_depths(run.out, run.scene)[frame.name]
    height, width = found.depth.shape
    assert raw.depth[height // 2, width // 2] == 5 and found.depth[height // 2, width // 2] == pytest.approx(
        1, rel=1e-3
    )
    assert found.depth[0, 0] == 5 and found.depth.dtype == np.float16
    (run.out / "mirrors.json").unlink()
    assert (trusted_depths(run.out, run.scene)[frame.name].depth == 5).all()


def test_the_setting_decides_and_what_the_mesh_before_had_is_gone(run, monkeypatch):
    lines, views, path = [], [object()], run.out / "mirrors.json"
    trust = read_trust(run.out / "trust.npz")
    monkeypatch.setattr("room2dgs.mirrors.find.find_mirrors", lambda small: [MIRROR] if len(small) else [])
    folder = RunFolder(run.out, lines.append)
    found = pipeline.without_mirrored(views, run.scene, trust, run.config, folder)
    assert found is not views and path.is_file()
    assert lines == ["mesh: 1 mirrors (1.4 x 1.1 m); what they show is left out (mesh.glass=keep: it stays)"]
    run.config.mesh.glass = "keep"
    assert pipeline.without_mirrored(views, run.scene, trust, run.config, folder) is views
    assert not path.exists() and len(lines) == 1
    run.config.mesh.glass = "leave_out"
    assert pipeline.without_mirrored(views, run.scene, {}, run.config, folder) is views
