"""`room2dgs bench table`: rows of studies, meshes of other programs, and one picture of both."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from room2dgs import cli
from room2dgs.commands import ablate, bench_table
from room2dgs.config import TermConfig, load_config
from room2dgs.study.method_table import METHODS, OURS, PUBLISHED, Line, picture
from room2dgs.train.schedule import term_weight

VALUES = {"f_score": 0.6, "f_score_2cm": 0.3, "psnr_db": 24.5, "run_s": 90.0, "primitives": 12345.0, "recall": 0.5}


@pytest.fixture
def studies(monkeypatch):
    """`ablate` and `eval` write made-up figures; gives what they were called with."""
    asked = []

    def study(argv):
        asked.append(argv)
        out = next(text for text in argv if text.startswith("out=")).removeprefix("out=")
        names = next(text for text in argv if text.startswith("experiment=")).removeprefix("experiment=").split(",")
        rows = [
            {"name": name, "values": {key: {"mean": value, "spread": None} for key, value in VALUES.items()}}
            for name in names
        ]
        rows[-1]["values"] = {}  # a run that failed
        path = bench_table.Path(out)
        path.mkdir(parents=True)
        (path / "ablation.json").write_text(json.dumps({"rows": rows}))
        return 3

    def scored(config):
        out = bench_table.Path(config.out)
        out.mkdir(parents=True)
        figures = {"area": {"f_score_5cm": 0.7, "f_score_2cm": 0.4}}
        (out / "metrics.json").write_text(
            json.dumps({"protocol": "area", "protocols": figures, "f_score_5cm": 0.7, "threshold_m": 0.05})
        )

    monkeypatch.setattr(ablate, "main", study)
    monkeypatch.setattr(bench_table, "evaluate_mesh", scored)
    return asked


def test_rows_of_all_captures_and_meshes_stand_in_one_table(capture, studies, tmp_path, capsys):
    mesh = tmp_path / "theirs.ply"
    mesh.write_bytes(b"ply")
    out = tmp_path / "table"
    command = ["bench", "table", str(capture), f"out={out}", f"other=theirs:{mesh}", "train.seed=0,1"]
    assert cli.main(command) == 3  # that of a failed run
    (argv,) = studies
    assert argv[-5:] == [*bench_table.BRIEF, "train.seed=0,1"] and f"out={out / capture.name / 'runs'}" in argv
    rows = list(csv.DictReader((out / "bench_table.csv").open()))
    assert [row["method"] for row in rows] == [*METHODS, *OURS, "theirs"]
    assert rows[0]["f_score"] == "0.6" and rows[0]["psnr_db"] == "24.5" and rows[-2]["f_score"] == ""
    assert rows[-1]["f_score"] == "0.7" and rows[-1]["f_score_2cm"] == "0.4" and rows[-1]["psnr_db"] == ""
    said = capsys.readouterr().out
    assert "1.5" in said and "12,345" in said and "0.700" in said
    page = (out / "bench_table.html").read_text()
    assert "data:image/jpeg" in page and "SuGaR, published: F 0.366" in page


def test_the_rows_are_settings_that_can_be():
    for name in (*METHODS, *OURS):
        config = load_config([f"experiment={name}", "scene.path=x", "out=y"])
        assert (config.primitive == "gaussian3d") == ("3dgs" in name)


def test_rows_differ_in_short_runs_too():
    iterations = 300
    acting = []
    for name in METHODS:
        config = load_config([f"experiment={name}", "scene.path=room", "out=out", f"train.iterations={iterations}"])
        terms = {key: term for key, term in vars(config.loss).items() if isinstance(term, TermConfig)}
        of_it = {key for key, term in terms.items() if term_weight(iterations - 1, term, iterations) > 0}
        acting.append((config.primitive, frozenset(of_it)))
    assert len(set(acting)) == len(METHODS)


def test_labels_of_rows_in_one_place_stand_below_each_other():
    line = Line("room", "plain", {"psnr_db": 20.0, "f_score": 0.5})
    other = Line("room", "plain", {"psnr_db": 30.0, "f_score": 0.9})  # so that the axes are the same
    one, two = (int((picture(lines, "5cm") < 0.5).sum()) for lines in ([line, other], [line, line, other]))
    assert two > one + 100


def test_the_picture_has_a_drawing_for_each_capture_and_one_of_what_was_published():
    one = picture([Line("a", "full", VALUES)], "5cm")
    two = picture([Line("a", "full", VALUES), Line("b", "a mesh", {"f_score": 0.4})], "5cm")
    assert two.shape[1] == pytest.approx(1.5 * one.shape[1], abs=3) and np.isfinite(two).all()
    assert all(0 < value < 1 for pair in PUBLISHED.values() for value in pair)


@pytest.mark.parametrize(
    ("arguments", "sentence"), [(["other=theirs"], "write other=NAME:FILE"), (["other=a:nowhere.ply"], "is no file")]
)
def test_what_cannot_be_is_said_first(capture, studies, tmp_path, capsys, arguments, sentence):
    assert cli.main(["bench", "table", str(capture), f"out={tmp_path / 'out'}", *arguments]) == 2
    assert sentence in capsys.readouterr().err and not studies
