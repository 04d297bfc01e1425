"""What commands say and do one after the other, on one run's folder."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs.mesh.io import read_mesh


def advised(sentence: str) -> list[str]:
    """The command that a sentence tells to type."""
    return shlex.split(re.search(r"`room2dgs (.*?)`", sentence)[1])


def legend(out: Path) -> list[str]:
    """The error's ticks in the page."""
    text = (out / "report.html").read_text()
    part = re.search(r'<div data-key="error" hidden>(.*?)<p', text, re.S)[1]
    return [tick.removesuffix(" cm and more") for tick in re.findall(r'<span style="[^"]*">([^<]*)', part)]


@pytest.fixture
def tabled(story, tmp_path):
    """The table of some runs, as Markdown."""

    def rows(*runs: Path, code: int = 0) -> str:
        assert story.cli(["table", *map(str, runs), f"out={tmp_path / 'table'}"]) == code
        return (tmp_path / "table/table.md").read_text()

    return rows


def test_a_run_that_was_meshed_anew_is_no_row_of_a_table_until_it_is_scored(trained, copied, story, tabled):
    again = copied(trained)
    story.told("mesh", f"run={again}", "mesh.voxel_m=0.1")
    said = tabled(trained, again, code=2)
    assert "not scored since its mesh was made" in said
    story.told(*advised(said), "eval.samples=2000")
    said = tabled(trained, again)
    scores = [story.metrics(out)["f_score_5cm"] for out in (trained, again)]
    assert all(f"{score:.3f}" in said for score in scores) and scores[0] != scores[1]


def test_what_is_exported_is_the_newest_mesh(trained, copied, story):
    again = copied(trained)
    story.told("export", f"run={again}", "to=glb,ply")
    story.told("mesh", f"run={again}", "mesh.voxel_m=0.1")
    story.told("export", f"run={again}", "to=glb,ply")
    mesh = read_mesh(again / "mesh.ply")
    for name in ("mesh.glb", "mesh.ply"):
        written = trimesh.load(again / "export" / name, process=False, force="mesh")
        assert len(written.faces) == len(mesh.faces) < len(read_mesh(trained / "mesh.ply").faces)


def test_a_run_is_scored_by_either_name_of_its_folder(trained, copied, story):
    again = copied(trained)
    before = story.metrics(again)
    story.told("mesh", f"run={again}")
    story.told("eval", f"run={again}")
    after = story.metrics(again)
    assert (again / "mesh.ply").read_bytes() == (trained / "mesh.ply").read_bytes()
    assert {key: after[key] for key in ("f_score_5cm", "chamfer_m", "psnr_db")} == {
        key: before[key] for key in ("f_score_5cm", "chamfer_m", "psnr_db")
    }


def test_another_threshold_is_the_reports_until_the_next_scores(trained, copied, story):
    again = copied(trained)
    steps = []
    for more in (["eval.threshold_m=0.02"], []):
        story.told("eval", f"out={again}", *more)
        story.told("report", f"run={again}")
        steps.append(legend(again))
    assert steps[0] == ["0", "1", "2", "3", "4"] and steps[1][-1] == "10"


@pytest.mark.parametrize("verb", ["render", "export"])
def test_a_run_that_trained_nothing_says_so(untrained, refused, verb):
    more = ["to=splats,glb"] if verb == "export" else []
    said = refused(verb, f"run={untrained}", *more)
    assert "has no surfels: mesh.source=points trains nothing" in said
    assert not (untrained / "export").exists()


def test_a_run_that_trained_nothing_has_mesh_plan_and_report(untrained, copied, story):
    again = copied(untrained)
    story.told("export", f"run={again}", "to=glb,obj")
    story.told("plan", f"run={again}", "up=z")
    story.told("report", f"run={again}")
    story.told("eval", f"run={again}", "eval.threshold_m=0.1")
    assert story.metrics(again)["f_score_10cm"] >= story.metrics(untrained)["f_score_5cm"]
    walls = json.loads((again / "plan/plan.json").read_text())
    assert len(re.findall(r"wall_\d", json.dumps(walls))) >= 2


@pytest.mark.parametrize(
    ("lacks", "argv"),
    [
        ("surfels.safetensors", ["mesh"]),
        ("surfels.safetensors", ["render"]),
        ("mesh.ply", ["plan"]),
        ("mesh.ply", ["export", "to=glb"]),
    ],
)
def test_what_is_missing_is_made_by_the_command_that_the_sentence_names(trained, copied, refused, story, lacks, argv):
    again = copied(trained)
    (again / lacks).unlink()
    verb, *more = argv
    story.told(*advised(refused(verb, f"run={again}", *more)))
    assert (again / lacks).read_bytes() == (trained / lacks).read_bytes()
    story.told(verb, f"run={again}", *more)


def test_cameras_that_a_run_exports_draw_its_views(trained, copied, story):
    again = copied(trained)
    story.told("export", f"run={again}", "to=transforms")
    story.told("render", f"run={again}", "views=all")
    file = again / "export/transforms/transforms.json"
    story.told("render", f"run={again}", f"path={file}", "save=color")
    drawn = {path.stem: cv2.imread(str(path)) for path in (again / "renders/transforms").glob("*.png")}
    shown = [cv2.imread(str(path)) for kind in ("test", "train") for path in (again / "renders" / kind).glob("*.png")]
    assert len(drawn) == len(shown) == 6
    for beside in shown:
        own = beside[:, 80:160].astype(int)  # photo, colour, depth, normals
        assert min(np.abs(own - one).max() for one in drawn.values()) <= 1


def test_two_runs_are_two_rows(trained, untrained, story, tabled):
    rows = [line for line in tabled(trained, untrained).splitlines() if line.startswith("| room |")]
    assert len(rows) == 2
    for out, row in zip((trained, untrained), rows, strict=True):
        assert f"{story.metrics(out)['f_score_5cm']:.3f}" in row
