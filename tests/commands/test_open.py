"""`room2dgs open`, the last lines of a run, and presets by a word."""

from __future__ import annotations

import os
import webbrowser

import pytest

from room2dgs import cli
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.json_files import update_json
from room2dgs.pipeline.summary import summary
from room2dgs.runs.folder import write_config
from room2dgs.runs.verdict import VERDICT, Measures, verdict_of


@pytest.fixture
def run(tmp_path):
    folder = tmp_path / "my run"
    folder.mkdir()
    write_config(folder, load_config(["scene.path=room", f"out={folder}"]))
    for number, name in enumerate(("mesh.ply", "report.html")):
        (folder / name).write_text("")
        os.utime(folder / name, (1000 + number, 1000 + number))
    update_json(folder / "metrics.json", {"seconds": {"mesh": 3.0}, "peak_memory_mb": 100.0})
    return folder


@pytest.mark.parametrize("found", [True, False])
def test_the_page_is_opened_or_its_address_told(run, monkeypatch, capsys, found):
    asked = []
    monkeypatch.setattr(webbrowser, "open", lambda url: asked.append(url) or found)
    assert cli.main(["open", str(run)]) == 0
    assert asked == [(run / "report.html").as_uri()]
    said = capsys.readouterr().out
    assert "NOTE" not in said and ("no browser was found here" in said) != found


def test_a_page_of_an_earlier_mesh_says_so(run, monkeypatch, capsys):
    monkeypatch.setattr(webbrowser, "open", lambda url: True)
    os.utime(run / "mesh.ply", (2000, 2000))
    assert cli.main(["open", f"run={run}"]) == 0
    assert "the page is of an earlier mesh; room2dgs report" in capsys.readouterr().out


def test_without_a_page_the_command_that_makes_it_is_told(run, capsys):
    (run / "report.html").unlink()
    assert cli.main(["open", str(run)]) == 2
    assert "room2dgs report out=" in capsys.readouterr().err
    assert cli.main(["open"]) == 2


@pytest.mark.parametrize("good", [True, False])
def test_the_last_three_lines_are_verdict_place_and_next_step(run, good):
    verdict = verdict_of(Measures(coverage=0.9 if good else 0.1))
    update_json(run / "metrics.json", {VERDICT: verdict.as_dict()})
    *before, word, place, step = summary(run)
    assert word == f"verdict: {'good' if good else 'failed'}"
    assert place == f"look at: {run / 'report.html'} (room2dgs open '{run}')"
    assert step == ("next: " + (f"room2dgs view '{run}' walks through the room" if good else verdict.advice[0]))
    assert any("covers 10%" in line for line in before) != good


PRESETS = {
    "sketch": ["mesh.source=depth", "scene.image_width=320", "scene.keyframes=0.5", "prior.depth.second_pass=false"],
    "draft": ["mesh.source=depth", "scene.image_width=320"],
    "quick": ["experiment=quick"],
    "default": [],
    "fine": ["train.resolutions=[]"],
}


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_its_settings_and_single_ones_go_on_top(name):
    given = ["scene.path=a", "out=b"]
    assert load_config([*given, f"preset={name}"]) == load_config([*given, *PRESETS[name]])
    assert load_config([*given, f"preset={name}", "scene.image_width=99"]).scene.image_width == 99


def test_a_preset_starts_a_new_run(run):
    with pytest.raises(InputError, match="preset= starts a new run"):
        load_config(["preset=fine"], run / "config.yaml")
