"""What a report reads beside the figures, the log and the maps of trust, may be a stranger's: it does without."""

from __future__ import annotations

import os
import resource
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.depth.network.map_cache import is_cached
from room2dgs.logs import logged
from room2dgs.prepare.stage_cache import StageCache
from room2dgs.runs.page.plots import drawings, read_plots
from room2dgs.runs.trust import read_trust

GOOD = np.full((3, 4), 7, np.uint8)


def written(path, **arrays):
    with path.open("wb") as file:
        np.savez(file, **arrays)
    return path


@pytest.mark.parametrize(
    "arrays",
    [
        {"names": np.array(["a"]), "0/confidence": GOOD.astype(float), "0/agreeing": GOOD},
        {"names": np.array(["a"]), "0/confidence": GOOD[0], "0/agreeing": GOOD[0]},
        {"names": np.array(["a"]), "0/confidence": GOOD, "0/agreeing": GOOD[:2]},
        {"names": np.array(["a"]), "0/confidence": GOOD[:0], "0/agreeing": GOOD[:0]},
        {"names": np.array(["a"]), "0/confidence": GOOD},
        {"names": np.array("a"), "0/confidence": GOOD, "0/agreeing": GOOD},
        {"names": np.array([{}], dtype=object)},
        {"other": GOOD},
    ],
)
def test_maps_of_trust_that_are_none_are_none(tmp_path, arrays):
    assert read_trust(written(tmp_path / "trust.npz", **arrays)) == {}
    good = {"names": np.array(["a"]), "0/confidence": GOOD, "0/agreeing": GOOD}
    assert list(read_trust(written(tmp_path / "trust.npz", **good))) == ["a"]


def test_packed_maps_are_not_unpacked_beyond_what_a_map_can_have(tmp_path):
    path = written(tmp_path / "trust.npz", names=np.array(["a"]), **{"0/agreeing": GOOD})
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive, archive.open("0/confidence.npy", "w") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "|u1", "fortran_order": False, "shape": (20_000, 20_000)})
        for _ in range(400):
            file.write(bytes(1_000_000))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert read_trust(path) == {}
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # KiB


def test_a_pipe_is_not_waited_for(tmp_path):
    for name in ("trust.npz", "log.txt"):
        os.mkfifo(tmp_path / name)
    assert read_trust(tmp_path / "trust.npz") == {} and logged(tmp_path) == []


WORDS = st.sampled_from(
    ["iteration ", "9" * 5000, "1", "2", "/", ": ", "loss ", "1e400", "1.2.3", "0.5", " (", ")", "rgb ", "nan", "-inf",
     ", PSNR ", " dB", "held-out PSNR ", ", 7", " surfels", "e", "+", "-1e308", "1e308", "\n", "٣"]
)  # fmt: skip


@given(st.lists(WORDS, max_size=24).map("".join))
def test_any_log_gives_curves_of_numbers_or_none(text):
    for line in ("iteration 1/2: loss 0.5 (rgb 0.5), 3 surfels", text):
        drawn = drawings(read_plots([*line.splitlines(), "iteration 2/2: loss 0.1 (rgb 0.1), 3 surfels"]))
        assert all(
            "nan" not in line["points"] and "inf" not in line["points"] for one in drawn for line in one["lines"]
        )


SHAPE = (6, 8)


@pytest.mark.parametrize(
    ("arrays", "kept"),
    [
        ({"map": np.ones(SHAPE, np.float16)}, True),
        ({"map": np.ones(SHAPE, np.float32), "error": np.ones(SHAPE, np.float16)}, True),
        ({"map": np.ones(SHAPE)}, False),
        ({"map": np.ones(SHAPE, np.complex64)}, False),
        ({"map": np.full(SHAPE, "a")}, False),
        ({"map": np.ones((6, 9), np.float16)}, False),
        ({"map": np.ones(SHAPE, np.float16), "error": np.ones((2000, 2000), np.float16)}, False),
        ({"error": np.ones(SHAPE, np.float16)}, False),
    ],
)
def test_a_networks_map_of_another_kind_is_made_again(tmp_path, arrays, kept):
    assert is_cached(written(tmp_path / "0.npz", **arrays), SHAPE) == kept


def test_what_stages_left_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "0.npz")
    os.mkfifo(tmp_path / "match.json")
    assert not is_cached(tmp_path / "0.npz", SHAPE)
    assert StageCache(tmp_path).found("match", "key") is None
    (tmp_path / "poses.json").write_text("[" * 100_000)
    assert StageCache(tmp_path).found("poses", "key") is None
