"""A folder or a file as the first word of a command; commands and names that are mistyped or oddly written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from room2dgs import cli
from room2dgs.commands.first_word import OF_CAPTURES, OF_FOOTAGE, OF_RUNS, with_first_word
from room2dgs.commands.verbs import VERBS
from room2dgs.errors import InputError
from room2dgs.runs.folder import CONFIG

WITH_WORDS_OF_THEIR_OWN = {"demo", "app", "compare", "table", "completion", "doctor", "bench"}


@pytest.fixture(autouse=True)
def places(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("room", "a=b", "runs/one"):
        Path(name).mkdir(parents=True)
    Path("runs/one", CONFIG).write_text("")
    for name in ("walk.MP4", "scan.ply"):
        Path(name).write_bytes(b"")


def test_every_command_takes_a_first_word():
    assert {*OF_CAPTURES, *OF_RUNS, *OF_FOOTAGE} | WITH_WORDS_OF_THEIR_OWN == set(VERBS)


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("run room out=x", "run scene.path=room out=x"),
        ("run walk.MP4 out=x", "run video=walk.MP4 out=x"),
        ("run runs/one resume=true", "run out=runs/one resume=true"),
        ("run a=b out=x", "run scene.path=a=b out=x"),
        ("run gone out=x", "run scene.path=gone out=x"),
        ("run resume", "run resume"),  # a setting without a value, of which its own sentence speaks
        ("run -m scene.path=room,a=b", "run -m scene.path=room,a=b"),
        ("prepare room out=x", "prepare images=room out=x"),
        ("prepare walk.MP4 out=x", "prepare video=walk.MP4 out=x"),
        ("eval scan.ply gt=scan.ply scene=room", "eval pred=scan.ply gt=scan.ply scene=room"),
        ("eval runs/one", "eval run=runs/one"),
        ("export runs/one to=glb out=x", "export run=runs/one to=glb out=x"),
        ("plan runs/one out=x", "plan run=runs/one out=x"),
        ("view runs/one port=1", "view run=runs/one port=1"),
        ("table runs/one", "table runs/one"),
        ("view", "view"),
    ],
)
def test_the_word_gets_the_key_that_it_stands_for(typed, meant):
    verb, *rest = typed.split()
    assert [verb, *with_first_word(verb, rest)] == meant.split()


@pytest.mark.parametrize("typed", ["run room scene.path=room out=x", "run room video=walk.MP4", "view runs/one run=x"])
def test_a_word_and_its_key_contradict_each_other(typed):
    verb, *rest = typed.split()
    with pytest.raises(InputError, match=r"both say what .* works on; leave one out"):
        with_first_word(verb, rest)


def test_a_mistyped_command_is_guessed_and_a_folder_is_told_from_one(capsys):
    for typed, said in (("rnu", "did you mean run?"), ("raport", "did you mean report?"), ("room", "run room out=DIR")):
        assert cli.main([typed]) == 2
        assert said in capsys.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="file names are bytes on Linux alone")
@pytest.mark.parametrize("word", ["z\udcfcg", "scene.path=z\udcfcg"])
def test_a_name_that_is_no_utf_8_is_one_sentence(capsys, word):
    assert cli.main(["run", word, "out=x"]) == 2
    escaped = word.encode("ascii", "backslashreplace").decode()
    sentence = "is not written in UTF-8; give the file or folder another name"
    assert capsys.readouterr().err == f"room2dgs: {escaped} {sentence}\n"


def test_names_with_umlauts_in_a_locale_of_ascii_alone(tmp_path):
    (tmp_path / "Küche").mkdir()
    plain = {**os.environ, "PYTHONUTF8": "0", "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"}
    code = "import sys; from room2dgs.cli import main; sys.exit(main())"
    for start in (["-c", code], ["-m", "room2dgs"]):
        done = subprocess.run(
            [sys.executable, *start, "run", "Küche", "out=x"], env=plain, capture_output=True, check=False
        )
        assert done.returncode == 2
        assert "Küche is empty; give scene.path=DIR" in done.stderr.decode("utf-8")
