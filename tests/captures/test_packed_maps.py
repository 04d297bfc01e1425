"""Maps in few bytes: how far they are rounded, and that what is invalid stays so."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs import _C
from room2dgs.captures.cache import Cache
from room2dgs.captures.packed_maps import FARTHEST_M, NEAREST_M, digest, pack, unpack
from room2dgs.captures.stored_maps import StoredMaps
from room2dgs.captures.view_maps import ViewMaps


def maps(seed: int = 0, shape=(50, 70)) -> ViewMaps:
    rng = np.random.default_rng(seed)
    depth = np.exp(rng.uniform(np.log(NEAREST_M), np.log(FARTHEST_M), shape))
    normal = rng.normal(size=(*shape, 3))
    # the folds and corners of the octahedron among them
    normal.reshape(-1, 3)[:27] = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), -1).reshape(-1, 3) + np.array([0, 0, 1e-9])
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    values = depth, rng.random(shape), normal, rng.random(shape)
    return ViewMaps(*(part.astype(np.float32) for part in values), source="files")


def test_rounding_is_as_small_as_promised():
    exact = maps()
    found = unpack(pack(exact), exact.source)
    assert all(values.dtype == np.float32 for values in found[:4]) and found.source == "files"
    assert np.abs(found.depth / exact.depth - 1).max() < 8.6e-5
    chord = np.linalg.norm(found.normal.astype(float) - exact.normal, axis=-1)
    assert np.degrees(2 * np.arcsin(chord / 2)).max() < 4e-3
    assert np.abs(np.linalg.norm(found.normal, axis=-1) - 1).max() < 1e-6
    sure = exact.depth_confidence > 1 / 255
    assert np.abs(found.depth_confidence - exact.depth_confidence)[sure].max() < 0.00197
    assert sum(array.nbytes for array in pack(exact)) == 8 * exact.depth.size


def test_rounding_twice_is_rounding_once():
    once = unpack(pack(maps()))
    for first, second in zip(pack(once), pack(maps()), strict=True):
        np.testing.assert_array_equal(first, second)


def test_invalid_pixels_stay_invalid_and_valid_ones_valid():
    exact = maps()
    exact.depth[0, :4] = 0, np.nan, np.inf, -1
    exact.depth[1, :2] = 1e-9, 1e9  # clipped
    exact.normal[0, :3] = 0
    exact.normal[1, 0] = np.nan
    exact.depth_confidence[0, :3] = 0, 1e-6, 1
    found = unpack(pack(exact))
    assert (found.depth[0, :4] == 0).all() and (found.depth > 0).sum() == found.depth.size - 4
    np.testing.assert_allclose(found.depth[1, :2], [NEAREST_M, FARTHEST_M], rtol=1e-6)
    assert not found.normal[0, :3].any() and not found.normal[1, 0].any()
    assert found.normal.any(axis=-1).sum() == found.depth.size - 4
    assert found.depth_confidence[0].tolist()[:3] == [0, pytest.approx(1 / 255), 1]


def test_maps_that_are_not_there_stay_away():
    depth = maps().depth
    found = unpack(pack(ViewMaps(depth=depth)))
    assert found.depth is not None and found[1:4] == (None, None, None)
    assert unpack(pack(ViewMaps())) == ViewMaps()


@pytest.mark.parametrize("budget_mb", [0.0, 0.1, 100.0])
def test_stored_maps_are_the_same_bits_whatever_the_budget(budget_mb):
    stored = StoredMaps(Cache(budget_mb))
    for seed in range(5):
        stored.put(str(seed), maps(seed))
    assert list(stored) == list("01234") and len(stored) == 5 and "5" not in stored
    for seed in (3, 0, 4, 1, 2):
        wanted = unpack(pack(maps(seed)), "files")
        for one, other in zip(stored[str(seed)], wanted, strict=True):
            np.testing.assert_array_equal(one, other)
        assert stored.digest(str(seed)) == digest(pack(maps(seed)))


def test_every_map_counts_in_the_digest():
    exact = maps()
    others = [
        exact._replace(**{name: np.where(np.arange(70) == 3, np.float32(0.5), getattr(exact, name))})
        for name in ("depth", "depth_confidence", "normal_confidence")
    ]
    others += [exact._replace(normal=-exact.normal), exact._replace(depth=None), exact._replace(depth_confidence=None)]
    digests = [digest(pack(each)) for each in (exact, *others)]
    assert len(set(digests)) == len(digests) and digest(pack(maps())) == digests[0]


UNIT, NO_NORMAL = np.float32(32767), -32768


def packed_by_numpy(normal: np.ndarray) -> np.ndarray:
    """What `pack` does to normals, step by step."""
    valid = np.isfinite(normal).all(-1) & normal.any(-1)
    x, y, z = (np.where(valid, normal[..., axis], np.float32(axis == 2)) for axis in range(3))
    size = np.abs(x) + np.abs(y) + np.abs(z)
    x, y = x / size, y / size
    folded = np.copysign(1 - np.abs(y), x), np.copysign(1 - np.abs(x), y)
    codes = [np.where(z < 0, fold, flat) * UNIT for fold, flat in zip(folded, (x, y), strict=True)]
    return np.where(valid, np.round(codes), NO_NORMAL).astype(np.int16)


def unpacked_by_numpy(codes: np.ndarray) -> np.ndarray:
    x, y = codes * (1 / UNIT)
    size = np.abs(y) + np.abs(x)
    z, fold = 1 - size, np.maximum(size - 1, 0)
    axes = np.stack([x - np.copysign(fold, x), y - np.copysign(fold, y), z])
    length = np.sqrt(axes[0] * axes[0] + axes[1] * axes[1] + axes[2] * axes[2])
    length[codes[0] == NO_NORMAL] = np.inf
    return np.moveaxis(axes / length, 0, -1)


@pytest.mark.parametrize("isa", ["baseline", "avx2", "avx512"])
@pytest.mark.parametrize("shape", [(1, 1), (3, 7), (50, 70)])
def test_normals_are_packed_to_the_same_bits_on_every_instruction_set(isa, shape, monkeypatch):
    monkeypatch.setenv("ROOM2DGS_ISA", isa)
    normal = np.random.default_rng(shape[0]).normal(size=(*shape, 3)).astype(np.float32)
    special = np.array([0, np.nan, np.inf, -np.inf, 1e-42, -1, -0.0, 1, 3e38], np.float32)
    flat = normal.reshape(-1, 3)
    flat[: len(flat) // 2] = np.random.default_rng(1).choice(special, size=(len(flat) // 2, 3))
    with np.errstate(over="ignore"):
        expected = packed_by_numpy(normal)
    for given in (normal, np.moveaxis(np.ascontiguousarray(np.moveaxis(normal, -1, 0)), 0, -1)):
        packed = pack(ViewMaps(normal=given))
        assert np.array_equal(packed[2], expected)
        found = unpack(packed).normal
        assert found.tobytes() == unpacked_by_numpy(expected).tobytes()


def test_every_code_is_a_unit_normal_to_the_same_bits():
    codes = np.random.default_rng(0).integers(-32767, 32768, (2, 300, 300)).astype(np.int16)
    codes.reshape(2, -1)[:, :4] = [[0, 32767, -32767, 0], [0, 0, 32767, -32767]]
    empty = np.zeros(0, np.uint8)
    found = unpack((empty.astype(np.uint16), empty, codes, empty)).normal
    assert found.tobytes() == unpacked_by_numpy(codes).tobytes()
    assert np.abs(np.linalg.norm(found, axis=-1) - 1).max() < 1e-6


def test_arrays_that_do_not_fit_are_refused():
    normals, codes = np.zeros((3, 5), np.float32), np.zeros((2, 5), np.int16)
    for call, error in (
        (lambda: _C.pack_normals(normals, codes[:, :4].copy()), ValueError),
        (lambda: _C.pack_normals(normals.astype(np.float64), codes), TypeError),
        (lambda: _C.unpack_normals(codes.astype(np.int32), normals), TypeError),
        (lambda: _C.unpack_normals(codes[:1], normals), ValueError),
    ):
        with pytest.raises(error):
            call()
