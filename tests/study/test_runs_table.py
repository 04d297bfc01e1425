"""Runs as a table: the right number under the right heading, and a sentence for a folder without scores."""

from __future__ import annotations

import json

from room2dgs.study.runs_table import main

METRICS = {
    "iterations": 3000, "f_score_5cm": 0.8764, "precision_5cm": 0.9, "recall_5cm": 0.85, "accuracy_m": 0.0173,
    "completion_m": 0.029, "psnr_db": 26.44, "ssim": 0.866, "primitives": 64510, "peak_memory_mb": 1998.1,
    "protocol": "area", "protocols": {"area": {"f_score_2cm": 0.74}},
    "seconds": {"points": 36.0, "train": 222.0, "mesh": 33.0},
}  # fmt: skip


def test_a_run_is_a_row(tmp_path, capsys):
    run = tmp_path / "room"
    run.mkdir()
    (run / "metrics.json").write_text(json.dumps(METRICS))
    assert main([str(run)]) == 0
    heading, _, cells = (line.strip("| ").split(" | ") for line in capsys.readouterr().out.strip().splitlines())
    table = dict(zip(heading, cells, strict=True))
    assert table["run"] == "room" and table["F @ 5 cm"] == "0.876" and table["F @ 2 cm"] == "0.740"
    assert table["accuracy"] == "1.7 cm" and table["surfels"] == "64,510"
    assert table["points + train + mesh"] == "0.6 + 3.7 + 0.6 min" and table["memory"] == "2.0 GB"


def test_a_run_without_scores_is_named(tmp_path, capsys):
    assert main([str(tmp_path)]) == 2
    assert "metrics.json" in capsys.readouterr().err
    (tmp_path / "metrics.json").write_text(json.dumps({**METRICS, "f_score_5cm": None}))
    assert main([str(tmp_path)]) == 2
