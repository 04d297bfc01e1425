"""Which views are compared, and what is kept of them."""

import numpy as np
import pytest
import torch

from room2dgs.config import MultiviewConfig
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.view_selection import neighbours_by_pose
from room2dgs.train.depth_cache import DepthCache
from room2dgs.train.grey import grey_photo

K = np.array([[100.0, 0, 80], [0, 100.0, 60], [0, 0, 1]])
CONFIG = MultiviewConfig(
    neighbours=8, max_angle_deg=30.0, min_baseline_m=0.05, max_baseline_m=1.0, samples=64, patch=7, min_std=0.01
)


def neighbours(cameras, **changes):
    """By the settings of `CONFIG`."""
    given = vars(CONFIG) | changes
    limits = (given[name] for name in ("neighbours", "min_baseline_m", "max_baseline_m", "max_angle_deg"))
    return neighbours_by_pose(cameras, *limits)


def camera(x: float, degrees: float = 0.0) -> Camera:
    """At (x, 0, 0), looking along z, turned about y."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    world_from_cam = np.eye(4)
    world_from_cam[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    world_from_cam[0, 3] = x
    return Camera(K, 160, 120, np.linalg.inv(world_from_cam))


def of_first(*cameras: Camera, **changes) -> list[int]:
    return neighbours(cameras, **changes)[0].tolist()


def test_cameras_that_only_turn_have_no_neighbour():
    assert [len(n) for n in neighbours([camera(0, a) for a in (0, 5, 10)])] == [0, 0, 0]
    assert [len(n) for n in neighbours([camera(0)])] == [0]


def test_neighbours_are_apart_but_not_far_and_look_the_same_way():
    assert of_first(camera(0), camera(0.04), camera(0.06), camera(0.99), camera(1.01)) == [2, 3]
    assert of_first(camera(0), camera(0.2, 29), camera(0.2, 31), camera(0.2, -29), camera(0.2, 180)) == [3, 1]
    assert of_first(camera(0), camera(0.2, -29), max_angle_deg=20.0) == []


def test_the_best_come_first_and_no_more_than_wanted():
    # 0.06 m is a narrow base for a room, 0.15 m a good one; beyond that the views share ever less
    line = [camera(x) for x in (0, 0.9, 0.06, 0.15, 0.5)]
    assert of_first(*line) == [3, 2, 4, 1]
    assert of_first(*line, neighbours=2) == [3, 2]
    lists = neighbours([camera(0.1 * i) for i in range(12)])
    assert all(len(n) == 8 and len(set(n.tolist())) == 8 and i not in n for i, n in enumerate(lists))


def test_grey_photos_and_their_texture():
    image = torch.full((30, 40, 3), 100, dtype=torch.uint8)
    image[..., 0] = 200
    image[10:20, 15:25] += torch.randint(0, 40, (10, 10, 1), generator=torch.Generator().manual_seed(0)).byte()
    photo = grey_photo(image, 7, 0.01)
    assert photo.grey[0, 0].item() == pytest.approx((0.299 * 200 + 0.587 * 100 + 0.114 * 100) / 255, rel=1e-5)
    textured = photo.textured.numpy()
    patches = np.lib.stride_tricks.sliding_window_view(photo.grey.numpy(), (7, 7))
    wanted = np.zeros((30, 40), bool)
    wanted[3:-3, 3:-3] = patches.std(axis=(2, 3)) >= 0.01
    np.testing.assert_array_equal(textured, wanted)
    assert textured.any() and not textured[:, :10].any()
    # no patch hangs over the border
    noisy = torch.randint(0, 255, (12, 12, 3), generator=torch.Generator().manual_seed(0)).byte()
    inside = grey_photo(noisy, 7, 0.01).textured
    assert inside[3:-3, 3:-3].all() and inside.sum() == 36


def test_depths_are_kept_inverse_at_every_other_pixel_and_for_one_size_only():
    depths = DepthCache()
    depth = (1 + torch.arange(15.0)).reshape(3, 5).requires_grad_()
    alpha = torch.ones(3, 5)
    alpha[2, 2] = 0.4
    depths.keep(4, 1.0, depth, alpha)
    kept = depths.get(4, 1.0)
    wanted = np.array([[1, 1 / 3, 1 / 5], [1 / 11, 0, 1 / 15]])
    np.testing.assert_allclose(kept, wanted, rtol=1e-4)  # 16 bits
    assert not kept.requires_grad
    assert depths.get(3, 1.0) is None and depths.get(4, 0.5) is None
    depths.keep(1, 0.5, torch.zeros(3, 5), alpha)
    assert depths.get(1, 0.5).tolist() == [[0, 0, 0], [0, 0, 0]]
    assert depths.get(4, 0.5) is None and depths.get(4, 1.0) is None
    again = DepthCache()
    again.load(depths.state())
    assert torch.equal(again.get(1, 0.5), depths.get(1, 0.5)) and again.get(1, 1.0) is None


@pytest.mark.parametrize(
    "change, said",
    [
        ("loss.multiview.patch=6", "odd"),
        ("loss.multiview.max_baseline_m=0.01", "min_baseline_m"),
        ("loss.multiview_geometric.ramp=-1", "ramp"),
        ("loss.multiview_photometric.end=-1", "end"),
        ("loss.distortion.start=nan", "start"),
        ("loss.multiview.samples=0", "samples"),
    ],
)
def test_impossible_settings_are_named(configure, change, said):
    with pytest.raises(InputError, match=said):
        configure(change)
