"""metrics.json of a run may be a stranger's: what is read of it is of its kind, or one sentence is all there is."""

from __future__ import annotations

import json
import os
import re

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from room2dgs import cli
from room2dgs.captures.scene import Scene
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.json_files import update_json
from room2dgs.runs.metrics import StageTimes, read_metrics, record
from room2dgs.runs.page import texts
from room2dgs.runs.schema import BY_KEY
from room2dgs.study.ablation import figures_of
from room2dgs.study.score_table import values_of

ODD = [
    "twenty", "5", True, -1, 0, 1e300, 10**400, [], [1], ["a"], {}, {"a": 1}, {"a": "b"}, {"a": None}, {"a": {"b": 1}},
    {"area": {"f_score_5cm": "high"}}, {"area": [1]}, {"truth_from_pred": [[1, 0], [0, 1]]},
    {"truth_from_pred": "none"}, {"precision": {"wrong": 1, "by_distance": {}}}, {"precision": 3}, None,
]  # fmt: skip
KEYS = [*BY_KEY, "f_score_5cm", "precision_5cm", "recall_5cm"]


def read_everywhere(out) -> None:
    """What reports, tables, studies and later commands make of a run's figures."""
    times = StageTimes()
    times["read"] = 1.0
    metrics = read_metrics(out)
    config = load_config(["scene.path=x", f"out={out}"])
    scene = Scene("x", (), ())
    texts.opening(config, metrics)
    texts.facts(scene, metrics)
    texts.warnings(scene, config, metrics, ["WARNING: x"])
    texts.tables(metrics)
    texts.closing(metrics)
    texts.threshold_m(metrics, config)
    values_of(metrics, "area", "5cm")
    figures_of(metrics, "5cm")
    record(out, {}, times)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.dictionaries(st.sampled_from(KEYS), st.sampled_from(ODD), min_size=1, max_size=3))
def test_a_figure_of_another_kind_is_one_sentence_or_does_no_harm(tmp_path, strange):
    path = tmp_path / "metrics.json"
    path.write_text(json.dumps(strange))
    try:
        read_everywhere(tmp_path)
    except InputError as error:
        assert str(path) in str(error) and any(f"{key} is no " in str(error) for key in strange)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("[" * 100_000, "holds no JSON"),
        ('{"a":' * 100_000, "holds no JSON"),
        ('{"psnr_db": NaN}', "NaN is no number of JSON"),
        ('{"any": {"x": 1e400}}', "1e400 is no number of JSON"),
        ('{"psnr_db": ' + "9" * 5000 + "}", "holds no JSON"),
        ("[1]", "holds no JSON object"),
        ("", "is empty"),
        ("\xff", "holds no JSON"),
    ],
)
def test_a_damaged_file_is_one_sentence(tmp_path, content, said):
    (tmp_path / "metrics.json").write_bytes(content.encode("latin-1"))
    for use in (read_metrics, lambda out: record(out, {}), lambda out: update_json(out / "metrics.json", {})):
        with pytest.raises(InputError, match=said):
            use(tmp_path)


def test_a_pipe_or_a_link_to_nothing_is_told(tmp_path):
    os.mkfifo(tmp_path / "metrics.json")
    with pytest.raises(InputError, match="is a pipe"):
        read_metrics(tmp_path)
    (tmp_path / "metrics.json").unlink()
    (tmp_path / "metrics.json").symlink_to("gone")
    with pytest.raises(InputError, match="which is not there"):
        read_metrics(tmp_path)


@pytest.mark.parametrize("verb", ["report", "mesh", "eval", "table"])
def test_commands_say_which_figure_is_wrong(finished, tmp_path, verb, capsys):
    (finished / "metrics.json").write_text(json.dumps({"protocols": {"area": ["best"]}}))
    argv = [str(finished), f"out={tmp_path / 'table'}"] if verb == "table" else [f"out={finished}"]
    assert cli.main([verb, *argv]) == 2
    said = capsys.readouterr()
    assert "metrics.json: protocols is no object of scores by protocol" in said.out + said.err
    assert "not your fault" not in said.err


def test_a_run_that_was_meshed_anew_has_a_report_without_scores(finished, capsys):
    assert cli.main(["eval", f"out={finished}"]) == 0
    assert cli.main(["report", f"out={finished}"]) == 0
    assert "F-score at 5cm" in (finished / "report.html").read_text()
    assert cli.main(["mesh", f"out={finished}", "mesh.voxel_m=0.05"]) == 0
    assert read_metrics(finished)["protocols"] is None
    assert cli.main(["report", f"out={finished}"]) == 0
    assert "F-score at" not in (finished / "report.html").read_text()


def test_the_legend_of_the_error_is_that_of_the_scores(finished, capsys):
    assert cli.main(["eval", f"out={finished}", "eval.threshold_m=0.02"]) == 0
    assert read_metrics(finished)["threshold_m"] == 0.02
    for forget in (False, True):  # a run from before says it under its protocol alone
        if forget:
            update_json(finished / "metrics.json", {"threshold_m": None})
        assert cli.main(["report", f"out={finished}"]) == 0
        text = (finished / "report.html").read_text()
        legend = re.search(r'<div data-key="error" hidden>(.*?)<p', text, re.S)[1]
        assert re.findall(r'<span style="left: ([\d.]+)%">([^<]*)', legend) == [
            ("0", "0"), ("25", "1"), ("50", "2"), ("75", "3"), ("100", "4 cm and more"),
        ]  # fmt: skip
