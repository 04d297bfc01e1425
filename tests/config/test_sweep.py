"""Lists of choices become combinations; everything else is left as it was typed."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.config.sweep import combinations


def overrides_of(texts) -> list[tuple[str, ...]]:
    return [one.overrides for one in combinations(texts)]


def test_the_first_key_changes_slowest_and_only_lists_are_chosen():
    found = combinations(["train.seed=0,1", "experiment=full,no_mv", "loss.dssim=0.2"])
    assert [one.overrides for one in found] == [
        ("train.seed=0", "experiment=full", "loss.dssim=0.2"),
        ("train.seed=0", "experiment=no_mv", "loss.dssim=0.2"),
        ("train.seed=1", "experiment=full", "loss.dssim=0.2"),
        ("train.seed=1", "experiment=no_mv", "loss.dssim=0.2"),
    ]
    assert found[1].chosen == {"train.seed": "0", "experiment": "no_mv"}


def test_a_later_key_takes_the_place_of_an_earlier_one():
    assert overrides_of(["train.seed=0,1,2", "loss.dssim=0.1", "train.seed=7"]) == [("train.seed=7", "loss.dssim=0.1")]


@pytest.mark.parametrize(
    "text",
    [
        "out=/rooms/a,b",  # a folder's name, not two folders
        "eval.protocols=[area,neuris]",
        "train.resolutions=[{fraction:0.5,until:100}]",
        "scene.path='a,b'",
        "nonsense",
        "x=(",
        "experiment=glob(*)",  # Hydra's own list of files; the settings' check names the choices
    ],
)
def test_what_is_no_list_of_choices_stands_as_typed(text):
    assert overrides_of([text]) == [(text,)]


def test_ranges_and_doubles():
    assert overrides_of(["train.seed=range(0,3)"]) == [("train.seed=0",), ("train.seed=1",), ("train.seed=2",)]
    assert overrides_of(["train.seed=4,4"]) == [("train.seed=4",)]


KEYS = st.from_regex(r"\A[a-z]{1,6}\Z")


@settings(max_examples=30, deadline=None)  # Hydra's parser takes milliseconds a text
@given(st.dictionaries(KEYS, st.lists(st.integers(0, 99), min_size=1, max_size=3), max_size=4))
def test_every_combination_once(choices):
    texts = [f"{key}={','.join(map(str, values))}" for key, values in choices.items() if key != "out"]
    found = overrides_of(texts)
    expected = 1
    for key, values in choices.items():
        expected *= len(set(values)) if key != "out" else 1
    assert len(found) == len(set(found)) == expected
