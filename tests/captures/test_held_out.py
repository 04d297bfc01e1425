"""A capture's own split is used by the photos' names, however they are written, or a word says that it is not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from room2dgs.captures.read import read_scene


def changed(path: Path, **values) -> None:
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))


@pytest.mark.parametrize(
    "name",
    ["images/frame_00010.png", "./images/frame_00010.png", "frame_00010.png", "frame_00010", "images\\frame_00010.png"],
)
def test_names_of_held_out_photos_may_lack_folders_and_suffixes(written, settings, name):
    root = written("nerfstudio")
    changed(root / "transforms.json", test_filenames=[name])
    scene = read_scene(settings(root))
    assert [frame.name for frame in scene.test] == ["images_frame_00010"]
    assert not scene.warnings


def test_a_name_that_two_folders_have_holds_none_of_them_out(written, settings, made):
    root = written("nerfstudio")
    meta = json.loads((root / "transforms.json").read_text())
    for side, frame in zip(("left", "right"), meta["frames"], strict=False):
        (root / side).mkdir()
        (root / frame["file_path"]).rename(root / side / "0.png")
        frame["file_path"] = f"{side}/0.png"
    changed(root / "transforms.json", frames=meta["frames"], test_filenames=["0.png", "right/0.png"])
    scene = read_scene(settings(root))
    assert [frame.name for frame in scene.test] == ["right_0"]
    assert "names 2 photos to hold out, 1 of which it does not have (0.png)" in " ".join(scene.warnings)


def test_a_split_of_other_photos_is_told_and_every_nth_is_held_out(written, settings):
    root = written("nerfstudio")
    changed(root / "transforms.json", test_filenames=["images/gone.png"])
    scene = read_scene(settings(root, test_every=3))
    assert len(scene.test) == 2
    assert "has none of them (images/gone.png)" in " ".join(scene.warnings)
    assert not read_scene(settings(root, split="every")).warnings


def test_scannetpp_lists_of_photos_that_are_gone(written, settings):
    root = written("scannetpp_dslr")
    changed(root / "dslr/train_test_lists.json", test=["DSC99999.JPG"])
    assert "DSC99999.JPG" in " ".join(read_scene(settings(root)).warnings)


@pytest.mark.parametrize(("lines", "share"), [("sequence1\nsequence2\n", "all"), ("sequence9\n", "none")])
def test_sequences_that_hold_out_all_or_none_are_told(written, settings_of, lines, share):
    root = written("sevenscenes")
    (root / "TestSplit.txt").write_text(lines)
    scene = read_scene(settings_of(root, "sevenscenes"))
    assert not scene.test
    assert f"holds out {share} of the sequences" in " ".join(scene.notes)
