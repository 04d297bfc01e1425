"""`room2dgs app`: who is let in, what may be uploaded and where it goes, a run from the page to its room."""

from __future__ import annotations

import http.client
import importlib.util
import json
import shutil
import threading
from pathlib import Path
from urllib.parse import quote, urlsplit

import pytest

from room2dgs import cli
from room2dgs.app.job import DONE, FAILED, STOPPED, Job
from room2dgs.app.server import App
from room2dgs.app.sources import capture_in, free_name, source_settings, uploaded
from room2dgs.errors import InputError

spec = importlib.util.spec_from_file_location("chromium", Path(__file__).parents[1] / "runs" / "chromium.py")
chromium = importlib.util.module_from_spec(spec)
spec.loader.exec_module(chromium)

SMALL = ["preset=sketch", "scene.image_width=64", "export.textured=false", "eval.samples=500"]


@pytest.fixture
def app(tmp_path):
    out = tmp_path / "my runs"
    out.mkdir()
    made = App(out, 0)
    thread = threading.Thread(target=made.serve, daemon=True)
    thread.start()
    yield made
    made.close()
    thread.join(5)


def asked(app, method, what, body=None, token=True, **headers):
    address = urlsplit(app.url)
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=20)
    given = json.dumps(body).encode() if isinstance(body, dict) else body
    connection.request(method, (address.path if token else "/") + what, given, headers)
    answer = connection.getresponse()
    text = answer.read()
    connection.close()
    return answer, json.loads(text) if answer.headers["Content-Type"] == "application/json" else text.decode()


@pytest.mark.parametrize("method", ["GET", "POST", "PUT"])
def test_nobody_comes_in_without_the_token_or_from_another_page(app, method):
    for what, more in (("state", {"token": False}), ("state", {"Origin": "http://evil.example"})):
        answer, _ = asked(app, method, what, b"{}", **more)
        assert answer.status == 403
    address = urlsplit(app.url)
    answer, _ = asked(app, "GET", "state", Host=f"rebound.example:{address.port}")
    assert answer.status == 403


def test_the_page_and_its_state(app):
    answer, text = asked(app, "GET", "")
    assert answer.status == 200 and "Drop a folder with photos" in text
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    assert answer.headers["Referrer-Policy"] == "no-referrer"
    assert asked(app, "GET", "state")[1] == {"job": None, "runs": []}
    assert asked(app, "GET", "nothing")[0].status == asked(app, "POST", "nothing", {})[0].status == 404


def put(app, upload, name, data):
    return asked(app, "PUT", f"upload?upload={upload}&name={quote(name)}", data)


def test_what_is_uploaded_lies_where_it_belongs(app):
    upload = asked(app, "POST", "new", {})[1]["upload"]
    assert put(app, upload, "zimmer ü/color/1.png", b"pixels" * 1000)[0].status == 200
    kept = app.out / ".uploads" / upload / "zimmer ü" / "color" / "1.png"
    assert kept.read_bytes() == b"pixels" * 1000
    answer, said = put(app, upload, "zimmer ü/color/1.png", b"other")
    assert answer.status == 400 and "twice" in said["why"] and kept.read_bytes() == b"pixels" * 1000
    answer, said = put(app, "0" * 16, "a.png", b"")
    assert answer.status == 400 and "drop a folder" in said["why"]


@pytest.mark.parametrize(
    "name",
    ["../a", "a/../../b", "/etc/x", "", ".", ".hidden", "a//b", "a/b/", "a\x00b", "a\\b", "x" * 300, "a/b/c/d/e/f/g"],
)
def test_names_that_lead_elsewhere_are_refused(tmp_path, name):
    with pytest.raises(InputError, match="cannot be uploaded"):
        uploaded(tmp_path, name)


def test_what_was_dropped_is_told_apart(wall, tmp_path):
    assert source_settings(wall) == [f"scene.path='{wall}'"]
    shutil.copytree(wall / "color", tmp_path / "it's photos")
    photos = tmp_path / "it's photos"
    assert source_settings(photos)[0].startswith("prepare.images='") and "it\\'s photos" in source_settings(photos)[0]
    (tmp_path / "walk.MP4").write_bytes(b"")
    assert source_settings(tmp_path / "walk.MP4") == [f"prepare.video='{tmp_path / 'walk.MP4'}'"]
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError):
        source_settings(tmp_path / "empty")
    with pytest.raises(InputError, match="does not exist"):
        source_settings(tmp_path / "gone")


def test_an_upload_is_its_only_folder_and_runs_have_names_of_their_own(tmp_path):
    with pytest.raises(InputError, match="nothing was uploaded"):
        capture_in(tmp_path)
    (tmp_path / "room").mkdir()
    assert capture_in(tmp_path) == tmp_path / "room"
    (tmp_path / "b.png").write_bytes(b"")
    assert capture_in(tmp_path) == tmp_path
    assert free_name(tmp_path, "room") == "room_2" and free_name(tmp_path, "../x y") == "x_y"
    assert free_name(tmp_path, "...") == "room_2" and free_name(tmp_path, "captures") == "captures_run"


def test_impossible_questions_get_a_sentence(app, tmp_path):
    for question, words in (
        ({"path": str(tmp_path / "gone")}, "does not exist"),
        ({}, "drop a folder"),
        ({"upload": ".."}, "drop a folder"),
        ({"path": str(tmp_path), "preset": "best"}, "preset=best is not known"),
    ):
        answer, said = asked(app, "POST", "start", question)
        assert answer.status == 400 and words in said["why"]
    assert asked(app, "POST", "start", b"[1]")[0].status == asked(app, "POST", "start", b"{")[0].status == 400
    assert asked(app, "POST", "start", b" " * 100_000)[0].status == 400
    assert app.state() == {"job": None, "runs": []}


ELSEWHERE = ["../secret.txt", "one/config.yaml", "one/../../secret.txt", ".uploads/report.html", "one", "one/link"]


@pytest.mark.parametrize("path", ELSEWHERE)
def test_only_what_a_run_shows_may_be_had(app, path):
    run = app.out / "one"
    run.mkdir()
    (app.out.parent / "secret.txt").write_text("secret")
    for name in ("config.yaml", "report.html"):
        (run / name).write_text(name)
    (run / "log.txt").symlink_to(app.out.parent / "secret.txt")
    assert asked(app, "GET", f"runs/{quote(path)}")[0].status == 404
    assert asked(app, "GET", "runs/one/log.txt")[0].status == 404  # a link
    assert asked(app, "GET", "runs/one/report.html")[1] == "report.html"
    assert asked(app, "GET", "state")[1]["runs"] == ["one"]


def test_a_run_tells_how_far_it_is_and_how_it_ended(wall, tmp_path):
    job = Job("it's", tmp_path / "it's", [*source_settings(wall), *SMALL])
    job.wait(120)
    state = job.state()
    assert state["state"] == DONE and state["share"] == 1.0, state
    assert (tmp_path / "it's" / "report.html").is_file()
    assert any(line.startswith("mesh: ") for line in state["lines"])


def test_a_run_that_cannot_be_says_why_and_one_that_is_stopped_ends(wall, tmp_path):
    shutil.copytree(wall, tmp_path / "wall")
    for pose in (tmp_path / "wall" / "pose").glob("*"):
        pose.write_text("nan")
    failed = Job("a", tmp_path / "a", [f"scene.path='{tmp_path / 'wall'}'"])
    failed.wait(120)
    assert failed.state()["state"] == FAILED and "pose" in failed.state()["why"]
    stopped = Job("b", tmp_path / "b", [*source_settings(wall), "train.iterations=30000"])
    stopped.stop()
    assert stopped.state()["state"] == STOPPED and not stopped.running
    stopped.stop()  # twice is no harm


def test_arguments_that_are_none_of_its_own_are_refused(tmp_path, capsys):
    assert cli.main(["app", "scene.path=x"]) == 2
    assert "scene.path=x is not known here" in capsys.readouterr().err
    (tmp_path / "file").write_text("")
    assert cli.main(["app", f"out={tmp_path / 'file'}", "browser=false"]) == 2
    assert "cannot be written" in capsys.readouterr().err


WAIT = """
new Promise((done, fail) => {
  const start = performance.now();
  const look = () => {
    const link = document.getElementById("look");
    if (!link.hidden) done(link.href);
    else if (performance.now() - start > 150000) fail(new Error(document.getElementById("far").textContent));
    else setTimeout(look, 100);
  };
  look();
})"""


@pytest.mark.slow
@pytest.mark.skipif(not chromium.CHROMIUM, reason="no Chromium here (Debian: apt install chromium)")
def test_a_folder_is_dropped_watched_and_looked_at(app, wall, tmp_path):
    room = tmp_path / "wall"
    shutil.copytree(wall, room)
    with chromium.tab(tmp_path / "profile") as tab:
        tab.call("Page.navigate", url=app.url)
        tab.until("document.getElementById('far') && document.readyState === 'complete'")
        node = tab.call("DOM.getDocument")["root"]["nodeId"]
        picker = tab.call("DOM.querySelector", nodeId=node, selector="#pick-folder")["nodeId"]
        tab.call("DOM.setFileInputFiles", nodeId=picker, files=[str(room)])
        tab.run("document.querySelector('[name=preset][value=sketch]').click()")
        tab.until("document.getElementById('dropped').textContent.startsWith('wall: ')")
        tab.run("document.getElementById('start').click()")
        address = tab.run(WAIT)
        assert tab.run("document.querySelector('#runs a').textContent") == "wall"
        assert tab.said == []
        tab.call("Page.navigate", url=address)
        tab.until("document.getElementById('viewer')?.dataset.drawn")
        assert tab.run("document.querySelector('h1').textContent") == "wall"
    assert (app.out / "captures" / "wall" / "wall" / "color").is_dir()
