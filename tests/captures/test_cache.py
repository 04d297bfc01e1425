"""A cache gives back what it took, whatever its budget, and leaves nothing on the disk."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.captures.cache import Cache
from room2dgs.errors import InputError

KB = 1e-3  # of the budget's unit


def arrays(seed: int, kilobytes: int = 1) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    whole = rng.integers(0, 255, 1000 * kilobytes - 8, dtype=np.uint8)
    return whole[:300], whole[300:].reshape(2, -1, 2), np.array([seed], np.int64)


def same(one, other) -> bool:
    return len(one) == len(other) and all(
        a.dtype == b.dtype and a.shape == b.shape and (a == b).all() for a, b in zip(one, other, strict=True)
    )


@given(
    st.integers(0, 6),
    st.lists(st.tuples(st.sampled_from(["put", "get", "discard"]), st.integers(0, 4), st.integers(0, 99)), max_size=40),
)
def test_it_is_a_dictionary_whatever_the_budget(kilobytes, steps):
    cache, wanted = Cache(kilobytes * KB), {}
    for what, key, seed in steps:
        if what == "put":
            wanted[key] = arrays(seed)
            cache.put(key, wanted[key])
        elif what == "discard":
            wanted.pop(key, None)
            cache.discard(key)
        else:
            found = cache.get(key)
            assert same(found, wanted[key]) if key in wanted else found is None
        assert cache.in_memory <= kilobytes * 1000


def test_the_least_recently_used_goes_to_the_folder_and_is_written_once(tmp_path):
    cache = Cache(2 * KB)
    cache.use_folder(tmp_path / "cache")
    for key in range(2):
        cache.put(key, arrays(key))
    assert not (tmp_path / "cache").exists()
    cache.get(0)
    cache.put(2, arrays(2))
    (first,) = (tmp_path / "cache").iterdir()
    written = first.stat().st_mtime_ns
    assert same(cache.get(0), arrays(0)) and same(cache.get(2), arrays(2))
    assert len(list(first.parent.iterdir())) == 1, "1 was used least recently"
    for _ in range(3):
        for key in range(3):
            assert same(cache.get(key), arrays(key))
    assert len(list(first.parent.iterdir())) == 3 and first.stat().st_mtime_ns == written
    cache.clear()
    assert not (tmp_path / "cache").exists() and cache.get(0) is None


def test_what_can_be_made_again_is_not_written(tmp_path):
    cache, made = Cache(1 * KB), []
    cache.use_folder(tmp_path / "cache")

    def make():
        made.append(1)
        return arrays(7)

    for _ in range(2):
        assert same(cache.get_or("grey", make, write=False), arrays(7))
    assert len(made) == 1
    cache.put("photo", arrays(1))
    assert cache.get("grey") is None and not (tmp_path / "cache").exists()
    assert same(cache.get_or("grey", make, write=False), arrays(7)) and len(made) == 2


def test_leftovers_of_a_killed_process_go(tmp_path):
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "0000000.npy").write_bytes(b"old")
    cache = Cache(0)
    cache.use_folder(tmp_path / "cache")
    assert not (tmp_path / "cache").exists()
    cache.put(0, arrays(0))
    assert same(cache.get(0), arrays(0))


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    cache = Cache(0)
    cache.use_folder(tmp_path / "file" / "cache")
    with pytest.raises(InputError, match=r"memory\.cache_mb.*file"):
        cache.put(0, arrays(0))


def test_room_is_what_displaces_nothing():
    cache = Cache(2 * KB)
    cache.put(0, arrays(0))
    assert cache.has_room(1000) and not cache.has_room(1001)
