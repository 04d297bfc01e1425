"""metrics.json and the table."""

import json

import numpy as np
import pytest

from room2dgs.errors import InputError
from room2dgs.eval.report import table, update_metrics


def test_update_keeps_other_keys_and_writes_plain_json(tmp_path):
    path = tmp_path / "run" / "metrics.json"
    update_metrics(path, {"psnr_db": 30.0, "f": 1})
    update_metrics(path, {"f": np.float32(0.5), "n": np.int64(3), "bad": float("nan"), "deep": {"x": [np.inf, 1]}})
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
    update_metrics(path, {"f": 1})
    with pytest.raises(TypeError):
        update_metrics(path, {"f": object()})
    assert json.loads(path.read_text()) == {"f": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["metrics.json"]


@pytest.mark.parametrize("content", ["{not json", "[1]", "\xff\xfe"])
def test_a_broken_file_is_named(tmp_path, content):
    path = tmp_path / "metrics.json"
    path.write_bytes(content.encode("latin-1"))
    with pytest.raises(InputError, match=r"metrics\.json"):
        update_metrics(path, {})


def test_table_has_every_protocol_and_no_invented_number():
    text = table({"area": {"f_score_5cm": 0.875, "accuracy_m": 0.0123}, "neuris": {"f_score_5cm": None}}, "5cm")
    assert "0.875" in text
    assert "12.3 mm" in text
    row = next(line for line in text.splitlines() if "F-score" in line)
    assert row.split("│")[3].strip() == "-"
