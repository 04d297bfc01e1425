"""The smooth field: the kernel is the oracle's, its minimum is one, gaps close, edges and thin parts stay."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs import _C
from room2dgs.geometry.cells import keys_of
from room2dgs.mesh.regularise import SHARE, SOFT, neighbours, regularise, solved
from room2dgs.mesh.voxel_table import BLOCK, VoxelTable, block_coordinates
from tests.oracles.regularise import energy, regularised

STEP = 0.28


def box(blocks: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """(N,) keys of a box of blocks, and (N, 512, 3) the voxels' indices, from 0."""
    grid = np.stack(np.meshgrid(*map(np.arange, blocks), indexing="ij"), axis=-1).reshape(-1, 3)
    keys = np.sort(keys_of(grid))
    inner = np.arange(BLOCK**3)
    offset = np.stack([inner % BLOCK, inner // BLOCK % BLOCK, inner // BLOCK**2], axis=1)
    return keys, block_coordinates(keys)[:, None] * BLOCK + offset


def in_box(values: np.ndarray, voxels: np.ndarray) -> np.ndarray:
    whole = np.zeros(voxels.reshape(-1, 3).max(axis=0) + 1)
    whole[tuple(voxels.reshape(-1, 3).T)] = values.ravel()
    return whole


@pytest.mark.parametrize("side", [1, 2, 4, 8])
def test_the_kernel_is_the_oracle(side):
    rng = np.random.default_rng(side)
    keys, _ = box((2, 3, 2))
    inner = np.arange(side**3)
    offset = np.stack([inner % side, inner // side % side, inner // side**2], axis=1)
    voxels = block_coordinates(keys)[:, None] * side + offset
    data = rng.uniform(-1, 1, voxels.shape[:2]).astype(np.float32)
    weight = np.where(rng.random(data.shape) < 0.5, 0, rng.uniform(0, 3, data.shape)).astype(np.float32)
    start = rng.uniform(-1, 1, data.shape).astype(np.float32)
    value, ahead = start.copy(), start.copy()
    dual = np.zeros((len(keys), 3, side**3), np.float32)
    _C.regularise(data, weight, neighbours(keys), value, ahead, dual, side, 0.2, 0.1, 30)
    whole = [in_box(part.astype(np.float64), voxels) for part in (start, data, weight)]
    expected = regularised(*whole, 0.2, 0.1, STEP, 30)
    np.testing.assert_allclose(in_box(value, voxels), expected, atol=2e-5)


def test_what_is_found_is_near_the_least_energy():
    rng = np.random.default_rng(0)
    keys, voxels = box((2, 2, 3))
    data = np.clip((voxels[..., 2] - 11.3) / 3, -1, 1) + rng.normal(0, 0.2, voxels.shape[:2])
    weight = (np.abs(voxels[..., 2] - 11.3) < 5) * rng.uniform(0.5, 3, data.shape)
    data, weight = data.astype(np.float32), weight.astype(np.float32)
    found = in_box(solved(data, weight, neighbours(keys)), voxels)
    whole = [in_box(part.astype(np.float64), voxels) for part in (data, weight)]
    least = energy(regularised(found, *whole, SHARE, SOFT, STEP, 3000), *whole, SHARE, SOFT)
    assert least <= energy(found, *whole, SHARE, SOFT) < 1.01 * least


def heights(field: np.ndarray) -> np.ndarray:
    """(X, Y) where the field turns from below 0 to above along z; NaN where it does not do so once."""
    rises = (field[..., :-1] < 0) & (field[..., 1:] >= 0)
    at = rises.argmax(axis=2)[..., None]
    low, high = (np.take_along_axis(field, at + k, axis=2)[..., 0] for k in (0, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(rises.sum(axis=2) == 1, at[..., 0] + low / (low - high), np.nan)


def test_a_hole_in_a_slanted_wall_closes_in_its_plane_and_noise_goes():
    rng = np.random.default_rng(1)
    keys, voxels = box((5, 5, 4))
    plane = 13.0 + 0.25 * (voxels[..., 0] - 20)
    data = np.clip((voxels[..., 2] - plane) / 3, -1, 1) + rng.normal(0, 0.1, voxels.shape[:2])
    weight = (voxels[..., 2] > plane - 3).astype(np.float32)
    weight[np.hypot(voxels[..., 0] - 20, voxels[..., 1] - 20) < 5] = 0
    found = heights(in_box(solved(data.astype(np.float32), weight, neighbours(keys)), voxels))
    off = found - 13.0 - 0.25 * (np.arange(40)[:, None] - 20)
    assert not np.isnan(off[4:-4, 4:-4]).any()
    hole = np.hypot(*(np.stack(np.meshgrid(np.arange(40), np.arange(40), indexing="ij")) - 20)) < 5
    assert np.abs(off[hole]).max() < 1.0
    measured = ~hole
    measured[:4] = measured[-4:] = measured[:, :4] = measured[:, -4:] = False
    assert off[measured].std() < 0.7 * 0.3  # the noise is 0.3 voxels


def test_the_surface_of_one_view_stays_beside_what_many_have_seen():
    keys, voxels = box((6, 3, 3))
    table = VoxelTable()
    table.rows_of(keys)
    many = voxels[..., 0] < 24
    for part, which, at in table.in_parts(keys):
        z = voxels[which][..., 2]
        known = z > 8
        part.tsdf[at] = np.clip((z - 11.3) / 3, -1, 1)
        part.weight[at] = np.where(known, np.where(many[which], 30, 1), 0)
        part.views[at] = part.weight[at]
    regularise(table, 1.0)
    field = np.concatenate([part.tsdf[at] for part, _, at in table.in_parts(keys)])
    found = heights(in_box(field, voxels))
    assert np.abs(found - 11.3).max() < 0.3


def test_the_same_bits_on_any_threads():
    rng = np.random.default_rng(2)
    keys, voxels = box((4, 4, 4))
    keys, voxels = keys[::3], voxels[::3]
    data, weight = (rng.uniform(0, 1, voxels.shape[:2]).astype(np.float32) for _ in range(2))
    before, found = _C.threads(), []
    try:
        for count in (1, 2, 3):
            _C.set_threads(count)
            found.append(solved(data, weight, neighbours(keys)))
    finally:
        _C.set_threads(before)
    assert all(np.array_equal(found[0], other) for other in found[1:])


def test_wrong_arguments_are_refused():
    parts = [np.zeros((1, 8), np.float32) for _ in range(2)]
    others = [np.zeros((1, 8), np.float32), np.zeros((1, 8), np.float32), np.zeros((1, 3, 8), np.float32)]
    alone = np.full((1, 6), -1, np.int32)
    for around, side, share in ((alone, 3, 0.1), (alone, 2, 0.0), (np.full((1, 6), 1, np.int32), 2, 0.1)):
        with pytest.raises(ValueError):
            _C.regularise(*parts, around, *others, side, share, 0.1, 1)
