"""Photos of a wall, each exposed differently: found, judged, told and undone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from room2dgs.captures.cache import Cache
from room2dgs.captures.levelled import levelled
from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import load_config
from room2dgs.exposure.photos import expected, gains_by_name, known, photo_gains, variation, with_gains
from room2dgs.geometry.camera import Camera
from room2dgs.pipeline.exposure import with_even_exposure, with_noted_exposure
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.train.views import Views

WIDTH, HEIGHT, FAR = 160, 120, 2.0
K = np.array([[140.0, 0, 80], [0, 140, 60], [0, 0, 1]])
GAINS = np.exp(np.random.default_rng(5).normal(0, [0.15, 0.12, 0.15], (8, 3)))
GAINS /= np.exp(np.log(GAINS).mean(axis=0))


def wall_colors(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(..., 3) levels of the wall at z = 2 m."""
    waves = [np.sin(3 * x + channel) * np.cos(4 * y - channel) + 0.2 * np.sin(25 * x * y) for channel in range(3)]
    return 110 + 50 * np.stack(waves, axis=-1)


def wall(folder: Path, gains: np.ndarray) -> Scene:
    """Cameras in a row before the wall."""
    frames = []
    for number, gain in enumerate(gains):
        pose = np.eye(4)
        pose[0, 3] = -0.15 * number
        camera = Camera(K, WIDTH, HEIGHT, pose)
        x, y, _ = np.moveaxis(FAR * camera.world_rays(), -1, 0)
        path = folder / f"{number}.png"
        photo = np.clip(np.round(gain * wall_colors(x + 0.15 * number, y)), 0, 255).astype(np.uint8)
        cv2.imwrite(str(path), photo[..., ::-1])
        frames.append(Frame(str(number), camera, path, index=number))
    return Scene(folder, tuple(frames), (), cache=Cache())


def depth_of(scene: Scene) -> dict[str, ViewMaps]:
    return {frame.name: ViewMaps(depth=np.full((60, 80), FAR, np.float32)) for frame in scene.train}


def tracks_of(scene: Scene) -> Tracks:
    """Points of the wall in all photos that see them."""
    rng = np.random.default_rng(1)
    xyz = np.column_stack([rng.uniform(-1, 2, 300), rng.uniform(-0.8, 0.8, 300), np.full(300, FAR)])
    frame, point, pixel = [], [], []
    for number, one in enumerate(scene.train):
        at, _ = one.camera.project(xyz)
        inside = np.flatnonzero(one.camera.inside(at))
        frame.append(np.full(len(inside), number))
        point.append(inside)
        pixel.append(at[inside])
    parts = np.concatenate(frame).astype(np.int32), np.concatenate(point).astype(np.int32)
    return Tracks(tuple(one.name for one in scene.train), *parts, np.concatenate(pixel).astype(np.float32))


@pytest.fixture(scope="module")
def varying(tmp_path_factory) -> Scene:
    return wall(tmp_path_factory.mktemp("varying"), GAINS)


@pytest.fixture(scope="module")
def constant(tmp_path_factory) -> Scene:
    return wall(tmp_path_factory.mktemp("constant"), np.ones((8, 3)))


def levelled_scene(scene: Scene) -> Scene:
    return with_gains(scene, gains_by_name(scene, photo_gains(scene.train, None, depth_of(scene))))


@pytest.mark.parametrize("by", ["tracks", "depth", "both"])
def test_the_gains_of_photos_are_found(varying, by):
    tracks = None if by == "depth" else tracks_of(varying)
    found = photo_gains(varying.train, tracks, {} if by == "tracks" else depth_of(varying))
    assert found is not None and known(found).all()
    assert np.abs(found.log - np.log(GAINS)).max() < 0.015


def test_what_is_seen_from_behind_something_is_not_compared(varying):
    maps = depth_of(varying)
    maps["3"].depth[:] = 1.0  # something before the wall, which the others do not see there
    found = photo_gains(varying.train, None, maps)
    assert not known(found)[3] and np.delete(known(found), 3).all()
    others = np.delete(found.log - np.log(GAINS), 3, axis=0)
    assert np.abs(others - others.mean(axis=0)).max() < 0.015


def test_a_photo_that_few_points_tie_to_others_is_not_known(varying):
    tracks = tracks_of(varying)
    kept = (tracks.frame != 3) | (np.cumsum(tracks.frame == 3) <= 60)
    parts = tracks.frame[kept], tracks.point[kept], tracks.pixel[kept]
    found = photo_gains(varying.train, Tracks(tracks.frames, *parts), {})
    assert not known(found)[3] and np.delete(known(found), 3).all()
    assert found.places[3] <= 60 and found.error[3].max() < 0.03  # its noise would not tell


def test_without_shared_places_nothing_is_said(varying):
    assert photo_gains(varying.train, None, {}) is None


def test_the_variation_is_what_nine_photos_of_ten_are_within(varying):
    found = variation(photo_gains(varying.train, None, depth_of(varying)))
    low, high = np.percentile(np.log(GAINS).mean(axis=1), [5, 95])
    assert found.exposure == pytest.approx(np.expm1((high - low) / 2), abs=0.01)
    assert 0.05 < found.white_balance < 0.5


def test_levelled_photos_agree_where_those_as_they_are_do_not(varying, constant):
    scene = levelled_scene(varying)
    for frame, plain in zip(scene.train, constant.train, strict=True):
        clear = frame.color().max(axis=-1) < 245
        difference = np.abs(frame.levelled_color().astype(int) - plain.color())[clear]
        assert np.percentile(difference, 99) <= 4
    assert np.abs(scene.train[0].color().astype(int) - constant.train[0].color()).mean() > 5


def test_white_stays_white_and_levels_stay_in_order():
    ramp = np.repeat(np.arange(256, dtype=np.uint8)[:, None, None], 3, axis=2)
    for gain in (0.5, 0.9, 1.0, 1.1, 2.0):
        result = levelled(ramp, (gain, 1.0, gain))[:, 0]
        assert result[255].tolist() == [255] * 3 and result[0].tolist() == [0] * 3
        assert (np.diff(result.astype(int), axis=0) >= 0).all()
        assert result[100, 0] == round(100 / gain) and result[100, 1] == 100


def test_training_compares_a_rendering_with_a_photo_as_that_was_exposed(varying, constant, tmp_path):
    scene = levelled_scene(varying)
    for index in (0, 5):
        view = Views(scene.train).at(index)
        same = view.exposed(Views(constant.train).at(index).target())
        assert (same - view.target()).abs().max() < 0.03
    # and what the photo clips is no error, however bright the rendering
    bright = replace(scene.train[0], gains=(4.0, 4.0, 4.0))
    white = tmp_path / "white.png"
    cv2.imwrite(str(white), np.full((HEIGHT, WIDTH, 3), 255, np.uint8))
    view = Views([replace(bright, color_path=white)]).at(0)
    assert (view.exposed(view.target()) == 1).all()
    view = Views([bright]).at(0)
    assert (view.exposed(view.target()) == 4 * view.target()).all()


def settings(scene: Scene, out: Path, exposure: str):
    return load_config([f"scene.path={scene.path}", f"out={out}", f"scene.exposure={exposure}"])


@pytest.mark.parametrize(
    ("which", "exposure", "said", "changed"),
    [
        ("varying", "auto", ": levelled", True),
        ("varying", "false", "", False),
        ("constant", "auto", "exposure varies by ±0%, white balance by ±0%: left as it is", False),
        ("constant", "true", ": levelled", True),
    ],
)
def test_a_run_levels_photos_that_vary_and_leaves_all_others(request, tmp_path, which, exposure, said, changed):
    scene = request.getfixturevalue(which)
    lines: list[str] = []
    run = RunFolder(tmp_path, lines.append)
    points = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    result = with_even_exposure(scene, points, depth_of(scene), settings(scene, tmp_path, exposure), run)
    assert (result is not scene) == changed
    assert all((frame.gains is not None) == changed for frame in result.train)
    assert any(said in line for line in lines) if said else not lines
    # and later steps read it again
    again = with_noted_exposure(scene, tmp_path)
    assert [frame.gains for frame in again.frames] == [frame.gains for frame in result.frames]


def test_gains_of_held_out_photos_are_those_between_their_neighbours_where_these_tell_any():
    order, logs = np.array([0, 1, 2, 4, 5, 7]), np.array([0.0, 0.1, 0.2, 0.4, 0.5, 0.7])[:, None] * (1, -1, 0.5)
    assert expected(order, logs, np.array([3, 6, 9])) == pytest.approx(np.array([[0.3], [0.6], [0.7]]) * (1, -1, 0.5))
    jumping = np.array([1.0, -1, 1, -1, 1, -1])[:, None] * np.ones(3)
    assert not expected(order, jumping, np.array([3])).any()
    assert not expected(order[:3], logs[:3], np.array([3])).any()


def test_held_out_photos_are_compared_as_their_neighbours_were_exposed(tmp_path):
    smooth = np.exp(0.2 * np.sin(np.arange(9) / 2))[:, None] * np.ones(3)
    whole = wall(tmp_path, smooth)
    scene = replace(whole, train=whole.train[:4] + whole.train[5:], test=whole.train[4:5])
    (held_out,) = levelled_scene(scene).test
    mean = np.exp(np.delete(np.log(smooth[:, 0]), 4).mean())
    assert held_out.gains == pytest.approx(smooth[4] / mean, abs=0.03)
    assert held_out.exposed(np.full((2, 2, 3), 0.9, np.float32)) == pytest.approx(
        min(0.9 * held_out.gains[0], 1), abs=0.01
    )


def test_photos_that_share_nothing_are_left_and_this_is_told(varying, tmp_path):
    lines: list[str] = []
    points = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    run = RunFolder(tmp_path, lines.append)
    assert with_even_exposure(varying, points, {}, settings(varying, tmp_path, "auto"), run) is varying
    assert "share too few places" in lines[0]
