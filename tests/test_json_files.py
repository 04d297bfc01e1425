"""Results as JSON files."""

import json

import numpy as np
import pytest

from room2dgs.errors import InputError
from room2dgs.json_files import update_json


def test_update_keeps_other_keys_and_writes_plain_json(tmp_path):
    path = tmp_path / "run" / "metrics.json"
    update_json(path, {"psnr_db": 30.0, "f": 1})
    update_json(path, {"f": np.float32(0.5), "n": np.int64(3), "bad": float("nan"), "deep": {"x": [np.inf, 1]}})
    assert json.loads(path.read_text()) == {
        "psnr_db": 30.0,
        "f": 0.5,
        "n": 3,
        "bad": None,
        "deep": {"x": [None, 1]},
    }
    assert [p.name for p in path.parent.iterdir()] == ["metrics.json"]


def test_a_value_that_json_cannot_hold_leaves_the_old_file(tmp_path):
    path = tmp_path / "metrics.json"
    update_json(path, {"f": 1})
    with pytest.raises(TypeError):
        update_json(path, {"f": object()})
    assert json.loads(path.read_text()) == {"f": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["metrics.json"]


@pytest.mark.parametrize("content", ["{not json", "[1]", "\xff\xfe"])
def test_a_broken_file_is_named(tmp_path, content):
    path = tmp_path / "metrics.json"
    path.write_bytes(content.encode("latin-1"))
    with pytest.raises(InputError, match=r"metrics\.json"):
        update_json(path, {})
