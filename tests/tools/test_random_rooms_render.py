"""Materials, light and photos of the random rooms."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.demo_room.geometry import box, parallelogram
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.pictures import KINDS, PER_KIND, mean_colors, pool
from room2dgs.tools.random_rooms.render import albedo_at, light_up, looks_of, render

pytestmark = pytest.mark.slow

LENGTH = 4.0


def plain(color, **changes):
    return materials.Surface("swatch", picture=0, tint=color, contrast=0.0, **changes)


@pytest.fixture(scope="module")
def cell():
    """A white cube seen from inside, a red wall at x = 0, a lamp under its ceiling."""
    white, red = plain((0.9, 0.9, 0.9)), plain((0.9, 0.1, 0.1))
    x, y, z = LENGTH * np.eye(3)
    patches = [
        parallelogram((0, 0, 0), x, y, white, "floor"),
        parallelogram(z, y, x, white, "ceiling"),
        parallelogram((0, 0, 0), y, z, red, "red wall"),
        parallelogram(x, z, y, white, "wall"),
        parallelogram((0, 0, 0), z, x, white, "wall"),
        parallelogram(y, x, z, white, "wall"),
        parallelogram(
            (1.8, 1.8, 3.95), (0, 0.4, 0), (0.4, 0, 0), materials.Light("emitter", radiance=(5, 5, 5)), "lamp"
        ),
    ]
    patches += box((3.0, 1.0, 0.0), (3.5, 1.5, 1.0), white, "box")
    return light_up(patches, np.random.default_rng(0))


def looking_along_x(at):
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]).T
    pose[:3, 3] = at
    return pose


def test_depth_and_normals_are_exact(cell):
    view = render(cell, 20.0, looking_along_x((0.5, 3.0, 2.0)), 32, 24, np.random.default_rng(0))
    assert view.depth[12, 16] == pytest.approx(3.5, abs=1e-4)
    np.testing.assert_allclose(view.normal[12, 16], [0, 0, -1], atol=1e-6)
    np.testing.assert_allclose(view.normal[23, 16], [0, -1, 0], atol=1e-6)  # the floor faces up
    assert (view.depth > 0).mean() > 0.9
    np.testing.assert_allclose(np.linalg.norm(view.normal[view.depth > 0], axis=-1), 1, atol=1e-5)


def test_a_lamp_is_bright_and_has_no_depth(cell):
    pose = np.eye(4)  # looks up
    pose[:3, 3] = (2.0, 2.0, 1.0)
    view = render(cell, 20.0, pose, 32, 24, np.random.default_rng(0))
    assert view.depth[12, 16] == 0 and not view.normal[12, 16].any()
    assert view.radiance[12, 16].min() > 1
    assert view.depth[0, 0] > 0


def test_a_red_wall_reddens_what_is_near(cell):
    view = render(cell, 8.0, looking_along_x((0.1, 2.0, 2.0)), 64, 24, np.random.default_rng(0))
    near, far = view.radiance[12, 1], view.radiance[12, 32]  # the side wall beside the red one, and the one opposite
    assert near[0] / near[1] > 1.1 * far[0] / far[1]


def test_the_pool_has_every_kind_and_its_means():
    assert pool().shape[0] == len(KINDS) * PER_KIND == len(mean_colors())
    assert not pool().flags.writeable
    np.testing.assert_allclose(mean_colors()[3], pool()[3].reshape(-1, 3).mean(0) / 255, atol=1e-5)


@pytest.mark.parametrize("name", ["wall", "floor", "wood", "cloth", "metal", "picture", "screen", "stone", "anything"])
def test_materials_are_drawn_within_bounds(name):
    rng = np.random.default_rng(1)
    for surface in (getattr(materials, name)(rng) for _ in range(200)):
        assert 0 <= surface.picture < len(pool())
        assert surface.tint is None or all(0 <= value <= 1 for value in surface.tint)
        assert 0 <= surface.gloss <= 1 and surface.contrast >= 0 and surface.roughness >= 0


def test_a_picture_that_fills_its_patch_is_upright():
    surface = materials.Surface("swatch", picture=KINDS.index("print") * PER_KIND, repeat=None)
    looks = looks_of([parallelogram((0, 0, 0), (2, 0, 0), (0, 0, 1), surface)], np.random.default_rng(0))
    image = pool()[surface.picture].astype(float) / 255
    grid = (np.arange(256) + 0.5) / 256
    u, v = (axis.ravel() for axis in np.meshgrid(grid, grid[::-1]))  # row 0 is the top
    seen = albedo_at(looks, np.zeros(len(u), int), np.stack([u, v], 1).astype(np.float32)).reshape(256, 256, 3)
    assert np.corrcoef(seen.ravel(), image.ravel())[0, 1] > 0.9
