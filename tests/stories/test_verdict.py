"""What a run says of itself: the same room with its own poses, and with those of other photos."""

from __future__ import annotations

import json
import shutil

import pytest

import room2dgs
from room2dgs.runs.folder import saved_settings

NEXT = {0: 3, 1: 5, 2: 0, 3: 1, 4: 2, 5: 4}  # photo -> whose pose it gets


@pytest.fixture(scope="module")
def shuffled(room, tmp_path_factory):
    """The room whose photos have each other's poses."""
    folder = tmp_path_factory.mktemp("shuffled") / "room"
    shutil.copytree(room, folder)
    for photo, other in NEXT.items():
        shutil.copy(room / f"pose/{other}.txt", folder / f"pose/{photo}.txt")
    return folder


@pytest.mark.parametrize("run", ["trained", "untrained"])
def test_a_good_room_is_not_failed(run, request, story):
    out = request.getfixturevalue(run)
    verdict = room2dgs.open_run(out).verdict
    assert not verdict.failed, verdict
    assert verdict.measures["photo_agreement"] > 0.8
    assert story.metrics(out)["verdict"]["word"] == verdict.word
    assert f"verdict: {verdict.word}" in (out / "log.txt").read_text()
    assert f"Verdict: {verdict.word}<" in (out / "report.html").read_text()


def test_the_same_room_with_shuffled_poses_is_failed(shuffled, tmp_path, story, capsys):
    out = tmp_path / "run"
    argv = [*story.settings(shuffled, out), "mesh.source=points"]
    assert story.cli(argv) == 0  # it did what it was told to
    verdict = room2dgs.open_run(out).verdict
    assert verdict.failed and "do not fit each other" in " ".join(verdict.reasons)
    assert verdict.advice
    last = (out / "log.txt").read_text().splitlines()[-5:]
    assert any("verdict: failed" in line for line in last), last
    assert "do not fit each other" in (out / "report.html").read_text()


def test_strict_ends_with_three_if_the_run_failed(shuffled, room, tmp_path, story, capsys):
    bad, good = tmp_path / "bad", tmp_path / "good"
    argv = [*story.settings(shuffled, bad), "mesh.source=points", "strict=true"]
    assert story.cli(argv) == 3
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith("room2dgs: the verdict on ") and str(bad) in said
    assert (bad / "mesh.ply").exists() and saved_settings(bad).strict
    assert story.cli([*story.settings(room, good), "mesh.source=points", "strict=true"]) == 0


def test_the_verb_mesh_judges_the_new_mesh(trained, copied, story):
    out = copied(trained)
    metrics = story.metrics(out)
    metrics["verdict"] = {"word": "failed", "reasons": ["an old one"], "advice": []}
    (out / "metrics.json").write_text(json.dumps(metrics))
    story.told("mesh", f"out={out}")
    assert "an old one" not in room2dgs.open_run(out).verdict.reasons
