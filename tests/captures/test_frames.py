"""Frames whose photos are distorted, masked, of several sizes or inside other files."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from room2dgs.captures.cache import Cache
from room2dgs.captures.depth_maps import DepthMap
from room2dgs.captures.lens import Lens, pinhole_of
from room2dgs.captures.photos import PhotoBytes, PhotoFile, Video, VideoFrame
from room2dgs.captures.scene import Frame
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera

SIZE = (320, 240)
LENSES = [
    Lens("OPENCV", (260.0, 255.0, 158.0, 122.0, -0.25, 0.06, 0.001, -0.002), SIZE, "test"),
    Lens("OPENCV", (260.0, 255.0, 158.0, 122.0, 0.2, -0.05, 0.0, 0.0), SIZE, "test"),
    Lens("FULL_OPENCV", (258.0, 258.0, 159.0, 120.0, 0.26, -0.95, -0.005, 0.003, 1.16, 0, 0, 0), SIZE, "test"),
    Lens("OPENCV_FISHEYE", (150.0, 150.0, 160.0, 120.0, 0.03, 0.01, -0.01, 0.002), SIZE, "test"),
    Lens("SIMPLE_RADIAL", (260.0, 160.0, 120.0, -0.1), SIZE, "test"),
]


def rays(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def opencv_project(lens: Lens, xy: np.ndarray) -> np.ndarray:
    """Pixels of (N, 2) directions by OpenCV, centres at +0.5; it knows nothing of COLMAP's models."""
    K, points = lens.K, np.concatenate([xy, np.ones((len(xy), 1))], axis=1)[:, None]
    if lens.model == "OPENCV_FISHEYE":
        return cv2.fisheye.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(lens.params[4:]))[0][:, 0]
    k = {"SIMPLE_RADIAL": [lens.params[-1], 0, 0, 0, 0], "OPENCV": lens.params[4:8]}.get(lens.model, lens.params[4:])
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(k, np.float64))[0][:, 0]


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: lens.model)
def test_an_undistorted_photo_shows_in_each_pixel_what_its_ray_sees(lens):
    """The photo's colours say where it was sampled: red is its column, green its row."""
    pinhole = pinhole_of(lens)
    column, row = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    image = pinhole.undistorted(np.stack([column, row], axis=-1).astype(np.float32))
    x, y = np.meshgrid(np.arange(pinhole.size[0]) + 0.5, np.arange(pinhole.size[1]) + 0.5)
    directions = np.stack([(x - pinhole.K[0, 2]) / pinhole.K[0, 0], (y - pinhole.K[1, 2]) / pinhole.K[1, 1]], axis=-1)
    expected = opencv_project(lens, directions.reshape(-1, 2)).reshape(image.shape)
    inner = (expected >= 0.5).all(axis=-1) & (expected <= np.array(SIZE) - 0.5).all(axis=-1)
    assert inner.mean() > 0.97
    assert np.abs(image - expected)[inner].max() < 0.05  # OpenCV interpolates in 32nds of a pixel


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: lens.model)
def test_no_pixel_is_invented(lens):
    pinhole = pinhole_of(lens)
    assert pinhole.size[0] <= SIZE[0] and pinhole.size[1] <= SIZE[1]
    assert pinhole.K[0, 0] <= lens.K[0, 0] + 1e-9
    x, y = np.meshgrid(np.arange(pinhole.size[0]) + 0.5, np.arange(pinhole.size[1]) + 0.5)
    directions = np.stack([(x - pinhole.K[0, 2]) / pinhole.K[0, 0], (y - pinhole.K[1, 2]) / pinhole.K[1, 1]], axis=-1)
    pixel = opencv_project(lens, directions.reshape(-1, 2)).reshape(directions.shape)
    inside = (pixel >= -0.01).all(axis=-1) & (pixel <= np.array(SIZE) + 0.01).all(axis=-1)
    assert (inside | (False if pinhole.valid is None else ~pinhole.valid)).all()
    assert inside.mean() > 0.9  # and little is given away


def test_coefficients_that_make_no_picture_are_refused():
    with pytest.raises(InputError, match="distortion"):
        pinhole_of(Lens("OPENCV", (260.0, 260.0, 160.0, 120.0, -30.0, 0.0, 0.0, 0.0), SIZE, "cameras.txt"))


def frame_of(tmp_path: Path, **changes) -> Frame:
    camera = Camera(np.array([[260.0, 0, 160], [0, 260, 120], [0, 0, 1.0]]), *SIZE, np.eye(4))
    path = tmp_path / "photo.png"
    if not path.exists():
        photo = np.random.default_rng(0).integers(0, 255, (SIZE[1], SIZE[0], 3), np.uint8)
        cv2.imwrite(str(path), photo)
    return replace(Frame("photo", camera, path), **changes)


def test_a_mask_hides_every_pixel_that_it_touches(tmp_path):
    white = np.full((SIZE[1], SIZE[0]), 255, np.uint8)
    white[100, 40] = 0
    cv2.imwrite(str(tmp_path / "mask.png"), white)
    frame = frame_of(tmp_path, mask_photo=PhotoFile(tmp_path / "mask.png"))
    assert (frame.mask() == (white > 0)).all()
    small = replace(frame, camera=frame.camera.resized(80, 60), cache=Cache())
    assert not small.mask()[25, 10] and small.mask().sum() == 80 * 60 - 1
    assert (small.mask() == replace(small, cache=None).mask()).all()  # packed in the cache
    assert frame_of(tmp_path).mask() is None


def test_masks_are_undistorted_with_the_photo(tmp_path):
    lens, white = LENSES[0], np.zeros((SIZE[1], SIZE[0]), np.uint8)
    white[:, :160] = 255
    cv2.imwrite(str(tmp_path / "mask.png"), white)
    pinhole = pinhole_of(lens)
    frame = frame_of(tmp_path, lens=lens, mask_photo=PhotoFile(tmp_path / "mask.png"))
    frame = replace(frame, camera=Camera(pinhole.K, *pinhole.size, np.eye(4)))
    mask = frame.mask()
    edge = np.array([(160.0 - lens.params[2]) / lens.params[0], 0.0])
    column = pinhole.K[0, 0] * lens.rays_at(lens.project(rays(edge[:1], edge[1:])))[0, 0] + pinhole.K[0, 2]
    assert abs(mask[pinhole.size[1] // 2].sum() - column) < 2
    assert frame.color().shape == (*pinhole.size[::-1], 3)


def test_depth_of_its_own_camera_comes_to_the_photos(tmp_path):
    """A wall that leans away to the right: each pixel must get the depth that its own ray meets."""
    K = ((70.0, 0.0, 40.0), (0.0, 71.0, 33.0), (0.0, 0.0, 1.0))
    x = (np.arange(80) + 0.5 - 40.0) / 70.0
    stored = np.tile((2000.0 / (1 - 0.3 * x)).round().astype(np.uint16), (60, 1))
    stored[0, 0] = 65535
    depth_map = DepthMap("test", lambda: stored, K=K, invalid=65535)
    depth = frame_of(tmp_path, depth_path=tmp_path / "x", depth_map=depth_map).depth()
    photo_x = np.tile((np.arange(320) + 0.5 - 160.0) / 260.0, (240, 1))
    photo_y = np.repeat((np.arange(240) + 0.5 - 120.0)[:, None] / 260.0, 320, axis=1)
    covered = (np.abs(photo_x) < 0.55) & (photo_y < 0.37) & (photo_y > -0.44)
    assert np.abs(depth - 2.0 / (1 - 0.3 * photo_x))[covered].max() < 0.3 * 2.0 / 70
    assert (depth[photo_y > 27.1 / 71 + 0.01] == 0).all() and depth_map.metres()[0, 0] == 0


def test_an_upright_frame_in_the_cache_is_not_taken_for_another(tmp_path):
    cache = Cache()
    frame = frame_of(tmp_path, cache=cache)
    inner = replace(frame, photo=PhotoBytes("archive: b.png", lambda: png(np.zeros((240, 320, 3), np.uint8))))
    assert frame.color().any() and not inner.color().any()


def png(image: np.ndarray) -> bytes:
    buffer = BytesIO()
    Image.fromarray(image).save(buffer, "png")
    return buffer.getvalue()


def test_frames_of_a_video_by_number(tmp_path):
    path = tmp_path / "walk.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48))
    for level in range(0, 200, 20):
        writer.write(np.full((48, 64, 3), level, np.uint8))
    writer.release()
    video = Video(path)
    for index in (3, 4, 9, 0, 7):  # back and forth
        assert abs(VideoFrame(video, index).pixels().mean() - 20 * index) < 4
    assert len(video) == 10 and video.size() == (64, 48)
    with pytest.raises(InputError, match="ends before frame 10"):
        video.frame(10)
    with pytest.raises(InputError, match="is missing"):
        Video(tmp_path / "absent.mp4").size()
