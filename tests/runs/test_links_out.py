"""A run's folder may be a stranger's: nothing is written through a link that leads out of it."""

from __future__ import annotations

import os
import shutil
import socket

import pytest

from room2dgs import cli
from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.links_out import refuse_links_out
from room2dgs.logs import append, in_lines, logged, run_log

VERBS = ("mesh", "render", "eval", "report", "export")


@pytest.fixture
def folders(tmp_path):
    """A run's folder, and one outside of it with a file that nobody may touch."""
    run, outside = tmp_path / "run", tmp_path / "outside"
    for folder in (run / "eval", outside):
        folder.mkdir(parents=True)
    (outside / "mine").write_text("mine\n")
    return run, outside


@pytest.mark.parametrize("name", ["log.txt", "renders", "export", "points", "checkpoints", "priors", "eval/views.png"])
@pytest.mark.parametrize("target", ["{outside}", "{outside}/mine", "../outside", "{outside}/new", "/dev/null"])
def test_a_link_out_of_the_folder_is_named(folders, name, target):
    run, outside = folders
    (run / name).symlink_to(target.format(outside=outside))
    with pytest.raises(InputError, match=rf"run/{name} is a link to .*; remove the link"):
        refuse_links_out(run)
    assert sorted(os.listdir(outside)) == ["mine"] and (outside / "mine").read_text() == "mine\n"


def test_links_inside_a_link_to_the_folder_itself_and_photos_are_fine(folders, tmp_path):
    run, outside = folders
    (run / "renders").mkdir()
    (run / "pictures").symlink_to("renders")
    (run / "capture").mkdir()
    (run / "capture" / "photo.jpg").symlink_to(outside / "mine")
    (tmp_path / "short").symlink_to(run)
    for folder in (run, tmp_path / "short", tmp_path / "not there"):
        refuse_links_out(folder)


def test_a_link_to_itself_or_out_by_a_detour_is_named(folders):
    run, _ = folders
    (run / "a").symlink_to("b")
    (run / "b").symlink_to("a")
    with pytest.raises(InputError, match="run/a is a link"):
        refuse_links_out(run)
    (run / "a").unlink()
    (run / "b").unlink()
    (run / "eval" / "up").symlink_to("../..")  # the folder around the run's
    with pytest.raises(InputError, match="run/eval/up is a link"):
        refuse_links_out(run)


@pytest.mark.parametrize("name", ["kept", "trust.npz", "eval/views.png"])
def test_a_pipe_or_a_socket_is_named_and_not_waited_for(folders, name):
    run, _ = folders
    os.mkfifo(run / name)
    with pytest.raises(InputError, match=rf"run/{name} is a pipe where files and folders belong; delete it"):
        refuse_links_out(run)
    (run / name).unlink()
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(os.path.relpath(run / name))
    with pytest.raises(InputError, match=rf"run/{name} is a socket where"):
        refuse_links_out(run)


@pytest.mark.parametrize("name", ["report.html", "log.txt", "metrics.json"])
def test_a_folder_in_the_place_of_a_file_of_a_run_is_named_at_once(finished, name, capsys):
    (finished / name).unlink(missing_ok=True)
    (finished / name).mkdir()
    assert cli.main(["report", f"out={finished}"]) == 2
    assert f"{finished / name} is a folder where a file belongs; " in capsys.readouterr().err


@pytest.mark.parametrize("name", ["renders", "export", "eval", "kept"])
def test_a_file_in_the_place_of_a_folder_of_a_run_is_named_at_once(finished, name, capsys):
    (finished / name).write_text("mine")
    before = sorted(os.listdir(finished))
    assert cli.main(["report", f"out={finished}"]) == 2
    assert f"{finished / name} is a file where a folder belongs; " in capsys.readouterr().err
    assert (finished / name).read_text() == "mine" and sorted(os.listdir(finished)) == before


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("name", ["log.txt", "renders", "export", "eval", "plan"])
def test_commands_write_nothing_outside(finished, tmp_path, verb, name, capsys):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "mine").write_text("mine\n")
    (finished / name).unlink(missing_ok=True)
    (finished / name).symlink_to(outside / "mine" if name == "log.txt" else outside)
    before = sorted(os.listdir(finished))
    argv = ["export", "to=splat", f"run={finished}"] if verb == "export" else [verb, f"out={finished}"]
    assert cli.main(argv) == 2
    assert f"{finished / name} is a link to" in capsys.readouterr().err
    assert sorted(os.listdir(outside)) == ["mine"] and (outside / "mine").read_text() == "mine\n"
    assert sorted(os.listdir(finished)) == before


def test_scores_of_a_mesh_look_at_what_they_write_alone(folders, wall, capsys):
    run, outside = folders
    (run / "mine").symlink_to(outside)
    argv = ["eval", f"pred={wall / 'gt_mesh.ply'}", f"scene={wall}", f"out={run}", "eval.samples=200"]
    assert cli.main(argv) == 0
    shutil.rmtree(run / "eval")
    (run / "eval").symlink_to(outside)
    assert cli.main(argv) == 2
    assert f"{run / 'eval'} is a link to" in capsys.readouterr().err and sorted(os.listdir(outside)) == ["mine"]


@pytest.mark.parametrize("given", ["pred", "gt"])
def test_a_pipe_or_a_folder_that_is_to_be_scored_is_called_so(tmp_path, wall, given, capsys):
    paths = dict.fromkeys(("pred", "gt"), wall / "gt_mesh.ply") | {given: tmp_path / "a.ply"}
    argv = ["eval", *(f"{key}={path}" for key, path in paths.items()), f"scene={wall}", f"out={tmp_path / 'scores'}"]
    os.mkfifo(tmp_path / "a.ply")
    assert cli.main(argv) == 2
    assert "a.ply is a pipe where a file belongs; give " in capsys.readouterr().err
    if given == "gt":
        with pytest.raises(InputError, match=r"a\.ply is a pipe where a file belongs; give scene\.gt_mesh the path"):
            read_scene(load_config([f"scene.path={wall}", "out=o", f"scene.gt_mesh={tmp_path / 'a.ply'}"]).scene)
    (tmp_path / "a.ply").unlink()
    (tmp_path / "a.ply").mkdir()
    assert cli.main(argv) == 2
    assert "a.ply is a folder where a file belongs; give " in capsys.readouterr().err


def test_a_log_that_becomes_a_link_or_a_pipe_is_not_written_to(folders, capsys):
    run, outside = folders
    log = run_log(run)
    log("one")
    (run / "log.txt").unlink()
    (run / "log.txt").symlink_to(outside / "mine")
    with pytest.raises(InputError, match="is no file of a log; delete it"):
        log("two")
    assert (outside / "mine").read_text() == "mine\n"
    (run / "log.txt").unlink()
    os.mkfifo(run / "log.txt")
    with pytest.raises(InputError, match="is no file of a log; delete it"):
        append(run / "log.txt", "three")
    assert logged(run) == []  # nor is it waited for


def test_a_name_cannot_colour_a_log_or_make_a_line_of_its_own(folders, capsys):
    run, _ = folders
    log = run_log(run)
    log("frame \x1b[31m\nWARNING: all is well\r\u202egpj.b left out")
    in_lines(log, "| a |\n| b |")
    said = ["frame \\x1b[31m\\nWARNING: all is well\\r\\u202egpj.b left out", "| a |", "| b |"]
    assert logged(run) == said
    assert capsys.readouterr().out.splitlines() == said
