"""A run's config.yaml may be a stranger's: text stays text, and what is no settings is told in a sentence, at once."""

from __future__ import annotations

import os
import time
from functools import reduce

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf

from room2dgs import cli
from room2dgs.config import dump_config, load_config
from room2dgs.config.composing import composed
from room2dgs.config.keys import path_keys
from room2dgs.config.overrides import quoted, unquoted
from room2dgs.config.saved import as_yaml
from room2dgs.errors import InputError

GIVEN = ["scene.path=room", "out=here"]
PATHS = [key for key in path_keys() if not key.endswith(".card")]  # a card is read at once
BOMB = "a: &a [1,1,1,1,1,1,1,1,1]\n" + "".join(
    f"{b}: &{b} [{','.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefghijk", "bcdefghijkl", strict=True)
)
FOLDER_NAMES = st.text(st.characters(exclude_characters="\0"), min_size=1).filter(
    lambda name: name.strip() == name and name != "null" and name[0] not in "'\""
)


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text(dump_config(load_config(GIVEN)))
    return path


def refusal(path) -> str:
    with pytest.raises(InputError) as caught:
        load_config((), path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)
    return str(caught.value)


@settings(max_examples=20, deadline=None)
@given(name=FOLDER_NAMES, key=st.sampled_from(PATHS))
@example(name="${out}", key="scene.path")
@example(name="${oc.env:HOME}", key="out")
@example(name="\\${out}", key="scene.path")
@example(name="${", key="points.cache")
@example(name="???", key="scene.path")
@example(name="\udcff\n\x1b", key="scene.path")  # bytes that are no UTF-8, as Python has them
@example(name="1e5", key="scene.path")
def test_any_path_is_the_same_on_the_command_line_and_in_the_file(tmp_path_factory, name, key):
    path, text = tmp_path_factory.mktemp("run") / "config.yaml", f"/tmp/{name}"
    config = load_config([*GIVEN, f"{key}={text}"])
    path.write_text(dump_config(config), encoding="utf-8")
    for one in (config, load_config((), path), load_config([f"{key}={text}"], path)):
        assert reduce(getattr, key.split("."), one) == text


@settings(max_examples=20, deadline=None)
@given(FOLDER_NAMES.filter(str.isprintable))
@example("/tmp/${out}")
@example("a\\${out}'\\")
@example("${oc.env:HOME}\\\\${")
def test_a_quoted_path_means_the_same_to_us_and_to_hydra(name):
    assert unquoted(quoted(name)) == name
    assert OmegaConf.to_container(composed([f"scene.path={quoted(name)}"]), resolve=True)["scene"]["path"] == name


@pytest.mark.parametrize("typed", ["/tmp/${out}", "'/tmp/${out}'", '"/tmp/${out}"', "'/tmp/\\${out}'"])
def test_a_folder_with_the_name_of_an_interpolation_is_no_interpolation(typed):
    assert load_config([*GIVEN, f"scene.path={typed}"]).scene.path == "/tmp/${out}"


@pytest.mark.parametrize("key", ["scene.path", "prior.cache", "scene.pose_frame", "train.iterations", "scene.topics"])
@pytest.mark.parametrize("value", ["${oc.env:ROOM2DGS_SECRET}", "${out}", "x ${oc.decode:${oc.env:ROOM2DGS_SECRET}}"])
def test_an_interpolation_in_saved_settings_is_refused(saved, monkeypatch, key, value):
    monkeypatch.setenv("ROOM2DGS_SECRET", "7777")
    *parents, name = key.split(".")
    tree = OmegaConf.to_container(OmegaConf.load(saved))
    reduce(dict.__getitem__, parents, tree)[name] = [value] if name == "topics" else value
    saved.write_text(as_yaml(tree))
    said = refusal(saved)
    assert f"{key} is " in said and "saved settings hold plain values" in said and "7777" not in said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB, "anchor or alias, line 1"),
        ("a: &a {b: *a}", "anchor or alias"),
        ("scene: {path: !!python/object/apply:os.system ['true']}", "YAML tag, line 1"),
        ("out: !!binary aGk=", "YAML tag"),
        ("a: " + "[" * 100_000, "nested more than"),
        ("a: " + "{a: " * 5_000 + "}" * 5_000, "nested more than"),
        ("".join(" " * level + "a:\n" for level in range(500)), "nested more than"),
        ("out: x\nout: y", "out comes twice"),
        ("scene: {path: x, path: y}", "path comes twice"),
        ("out: [" + "1," * 100_000 + "]", "far more values"),
        ("out: x\n" + "#" * (1 << 20), "too large"),
        ("? [a, b]\n: c", "is not the configuration of a run"),
        ("train: {iterations: " + "9" * 5000 + "}", "is not the configuration of a run"),
        ("scene.path: x\n'scene': 3", "is not the configuration of a run"),
        ("just text", "is not the configuration of a run"),
        ("--- {out: x}\n--- {out: y}", "is not the configuration of a run"),
    ],
)  # fmt: skip
def test_what_is_no_settings_is_one_sentence_at_once(saved, text, said):
    saved.write_text(text)
    start = time.process_time()
    assert said in refusal(saved)
    assert time.process_time() - start < 5  # minutes and all memory before


def test_a_file_in_another_encoding_is_told(saved):
    saved.write_bytes("out: ä".encode("latin-1"))
    assert "it is not UTF-8 text" in refusal(saved)


def test_a_pipe_is_not_waited_for(saved):
    saved.unlink()
    os.mkfifo(saved)
    assert "is a pipe where a file belongs" in refusal(saved)


@pytest.mark.parametrize("value", ["[" * 3000 + "]" * 3000, "9" * 5000])
def test_a_value_that_cannot_be_read_is_one_sentence(value):
    with pytest.raises(InputError) as caught:
        load_config([*GIVEN, f"scene.topics={value}"])
    assert "\n" not in str(caught.value)


def test_a_setting_that_is_asked_for_again_is_not_given(saved):
    with pytest.raises(InputError, match=r"scene\.stride is not given"):
        load_config(["scene.stride=???"], saved)


@pytest.mark.parametrize("argv", [["run", "scene.path=~no.such.user/x", "out=x"], ["report", "out=~no.such.user"]])
def test_the_home_of_nobody_is_one_sentence(argv, capsys):
    assert cli.main(argv) == 2
    assert "begins with ~ and a name that no user has" in capsys.readouterr().err
