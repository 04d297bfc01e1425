"""compare.html: what differs between two runs, both rooms, and one camera for both."""

from __future__ import annotations

import importlib.util
import json
import shutil
from pathlib import Path

import pytest
import yaml

from room2dgs import cli
from room2dgs.config import load_config
from room2dgs.json_files import update_json
from room2dgs.runs.page.compare import score_table, settings_table

spec = importlib.util.spec_from_file_location("chromium", Path(__file__).with_name("chromium.py"))
chromium = importlib.util.module_from_spec(spec)
spec.loader.exec_module(chromium)

NAMES = "a", "b"


@pytest.fixture
def two(finished, tmp_path):
    other = tmp_path / "other"
    shutil.copytree(finished, other)
    settings = yaml.safe_load((other / "config.yaml").read_text())
    settings["train"]["iterations"] = 77
    settings["out"] = str(other)
    (other / "config.yaml").write_text(yaml.safe_dump(settings))
    update_json(other / "metrics.json", {"f_score_5cm": 0.7, "psnr_db": 18.0})
    return finished, other


def test_the_page_has_both_rooms_and_what_differs(two, tmp_path, capsys):
    page = tmp_path / "new" / "compare.html"
    assert cli.main(["compare", *map(str, two), f"to={page}"]) == 0
    text = page.read_text(encoding="utf-8")
    assert "train.iterations" in text and "<td>77</td>" in text
    assert "<td>0.625</td>" in text and "<td>0.700</td>" in text
    assert 'id="bytes-a-mesh"' in text and 'id="bytes-b-mesh"' in text
    assert "default-src 'none'" in text and str(two[0].parent) not in text
    assert str(page) in capsys.readouterr().out


def test_scores_say_which_run_is_better():
    first = {"f_score_5cm": 0.6, "accuracy_m": 0.010, "psnr_db": 20.0, "mesh_faces": 1000, "seconds": {"train": 3.0}}
    second = {"f_score_5cm": 0.7, "accuracy_m": 0.012, "psnr_db": 20.001, "mesh_faces": 900}
    rows = {row["figure"]: row for row in score_table(NAMES, first, second).frame.to_dict("records")}
    said = {name: row["the second is"] for name, row in rows.items()}
    assert said == {
        "F-score at 5 cm": "better", "accuracy": "worse", "PSNR of held-out photos": "the same", "triangles": "-",
        "seconds in all": "-",
    }  # fmt: skip
    assert (rows["accuracy"]["a"], rows["seconds in all"]["b"]) == ("10.0 mm", "-")


def test_settings_that_differ_are_listed_without_folders():
    given = ["scene.path=/data/one/room", "out=/data/one/run"]
    table = settings_table(NAMES, load_config(given), load_config([*given, "mesh.voxel_m=0.03", "eval.gt=/scan/a.ply"]))
    assert [tuple(row) for row in table.frame[["setting", "b"]].itertuples(index=False)] == [
        ("mesh.voxel_m", "0.03"), ("eval.gt", "a.ply"),
    ]  # fmt: skip
    assert not len(settings_table(NAMES, load_config(given), load_config(given)).frame)


@pytest.mark.parametrize("words", [[], ["one"], ["one", "two", "three"]])
def test_two_runs_are_wanted(words, capsys):
    assert cli.main(["compare", *words]) == 2
    assert f"two runs are compared, {len(words)} given" in capsys.readouterr().err


def test_a_run_without_a_mesh_is_named(two, tmp_path, capsys):
    (two[1] / "mesh.ply").unlink()
    assert cli.main(["compare", *map(str, two), f"to={tmp_path / 'c.html'}"]) == 2
    assert f"room2dgs mesh out={two[1]}" in capsys.readouterr().err
    assert not (tmp_path / "c.html").exists()


LOOK = "['a', 'b'].every((letter) => document.getElementById('viewer-' + letter)?.dataset.drawn)"
SAME = """
new Promise((done) => {
  let tries = 0;
  const look = () => {
    const [a, b] = [...document.querySelectorAll(".viewer canvas")].map((canvas) => canvas.toDataURL());
    if ((a === b && a !== "BEFORE") || tries++ > 100) done(JSON.stringify([a === b, a]));
    else setTimeout(look, 100);
  };
  look();
})"""


@pytest.mark.slow
@pytest.mark.skipif(not chromium.CHROMIUM, reason="no Chromium here (Debian: apt install chromium)")
def test_one_camera_sees_both_rooms(two, tmp_path):
    page = tmp_path / "compare.html"
    assert cli.main(["compare", *map(str, two), f"to={page}"]) == 0
    with chromium.tab(tmp_path / "profile") as tab:
        tab.call("Page.navigate", url=page.as_uri())
        tab.until(LOOK)
        tab.run("document.getElementById('compare-turn').click()")
        same, before = json.loads(tab.run(SAME))
        assert same  # the meshes are the same, so their pictures are
        left, top, width, height = json.loads(tab.run(
            "(b => JSON.stringify([b.left, b.top, b.width, b.height]))"
            "(document.querySelector('#viewer-b canvas').getBoundingClientRect())"
        ))  # fmt: skip
        x, y = left + width / 2, top + height / 2
        for kind, moved in (("mousePressed", 0), ("mouseMoved", 60), ("mouseReleased", 60)):
            tab.call("Input.dispatchMouseEvent", type=kind, x=x + moved, y=y, button="left", buttons=1, clickCount=1)
        same, after = json.loads(tab.run(SAME.replace("BEFORE", before)))
        assert (same, after != before) == (True, True)
        assert tab.said == [] and len([url for url in tab.asked_for if url.startswith("file:")]) == 1


def test_other_captures_are_told(two, tmp_path, wall):
    copy = tmp_path / "copied"
    shutil.copytree(wall, copy)
    settings = yaml.safe_load((two[1] / "config.yaml").read_text())
    settings["scene"]["path"] = str(copy)
    (two[1] / "config.yaml").write_text(yaml.safe_dump(settings))
    page = tmp_path / "compare.html"
    assert cli.main(["compare", *map(str, two), f"to={page}"]) == 0
    assert "The runs are of two captures" in page.read_text(encoding="utf-8")
