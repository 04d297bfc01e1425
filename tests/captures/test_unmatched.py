"""A folder of depth maps or masks that fits nothing is told, with counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from room2dgs.captures.capture import Capture, Shot
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.read import read_scene
from room2dgs.captures.unmatched import unmatched, warn_unmatched
from room2dgs.tools.capture_layouts.registry import LAYOUTS


def touched(*paths: Path) -> None:
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


def test_nothing_to_say_without_a_folder_or_where_all_is_used(tmp_path):
    assert unmatched(tmp_path / "depth", [], "depth map") is None
    touched(tmp_path / "depth/1.png", tmp_path / "depth/.hidden", tmp_path / "depth/times.txt")
    assert unmatched(tmp_path / "depth", ["1.png"], "depth map") is None


def test_counts_of_a_folder_that_fits_in_part_or_not_at_all(tmp_path):
    touched(*(tmp_path / f"depth/{i}.npy" for i in range(5)), tmp_path / "depth/cam/6.png")
    assert "has 6 files, and none is the depth map of a photo" in unmatched(tmp_path / "depth", [], "depth map")
    assert "6 files, 4 of them" in unmatched(tmp_path / "depth", ["1.npy", "cam/6.png"], "depth map")


def capture_of(root: Path, photos: list[str], depth: str = "", mask: str = "") -> Capture:
    touched(*(root / name for name in photos))
    shots = []
    for name in photos:
        file = f"{Path(name).stem}.png"
        shots.append(
            Shot(
                name,
                root / name,
                np.eye(4),
                None,
                depth=depth_file(root / depth / file) if depth else None,
                mask=PhotoFile(root / mask / file) if mask else None,
            )
        )
        touched(*(root / folder / file for folder in (depth, mask) if folder))
    return Capture(root, "made", shots)


def test_folders_that_the_layout_does_not_read_are_warned_of(tmp_path):
    capture = capture_of(tmp_path, ["color/1.jpg", "color/2.jpg"])
    touched(tmp_path / "depths/1.png", tmp_path / "resized_anon_masks/1.png", tmp_path / "unmasked/1.png")
    warn_unmatched(capture)
    assert len(capture.warnings) == 2 and not capture.notes
    assert "depths has one file" in capture.warnings[0] and "anon_masks" in capture.warnings[1]


def test_what_is_used_is_no_news_and_what_lies_beside_it_is_noted(tmp_path):
    capture = capture_of(tmp_path / "room", ["a/color/1.jpg", "a/color/2.jpg"], depth="a/depth", mask="a/masks/cam")
    warn_unmatched(capture)
    assert not capture.notes and not capture.warnings
    touched(tmp_path / "room/a/depth/7.png", tmp_path / "room/a/depth_filtered/1.png")
    warn_unmatched(capture)
    assert not capture.warnings and len(capture.notes) == 2
    assert "3 files, 1 of them" in capture.notes[0] and "depth_filtered" in capture.notes[1]


def test_files_beside_the_photos_that_are_called_depth_or_mask_are_noted(tmp_path):
    capture = capture_of(tmp_path, ["frame1.color.png", "frame2.color.png", "depth_charge.png"])
    touched(
        *(tmp_path / f"frame{i}.depth.npy" for i in (1, 2)), tmp_path / "frame1_mask.png", tmp_path / "unmasked.png"
    )
    warn_unmatched(capture)
    assert not capture.warnings and len(capture.notes) == 2
    assert "2 files that are called a depth map" in capture.notes[0] and "frame1_mask.png" in capture.notes[1]


def test_what_the_reader_told_of_a_folder_is_not_told_again(tmp_path):
    capture = capture_of(tmp_path, ["color/1.jpg", "color/2.jpg"])
    touched(tmp_path / "depth/1.png", tmp_path / "masks/1.png")
    capture.notes.append(f"{tmp_path / 'depth'} has one file, which another program wrote")
    warn_unmatched(capture)
    assert len(capture.notes) == 1 and len(capture.warnings) == 1


def test_a_path_with_dots_and_a_relative_one_are_the_same_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    touched(tmp_path / "x/k")
    capture = capture_of(Path("x/../room"), ["1.jpg", "2.jpg"], depth="depth")
    warn_unmatched(capture)
    assert not capture.notes and not capture.warnings


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_whole_capture_has_nothing_unused(written, settings_of, name):
    scene = read_scene(settings_of(written(name), name))
    told = " | ".join((*scene.notes, *scene.warnings))
    assert not any(words in told for words in ("photo's", "no photo", "none is", "does not know", "left out")), told


@pytest.mark.parametrize(
    ("name", "folder", "words"),
    [
        ("replica", "masks", "the layout replica reads no masks from files"),
        ("replica", "depth", "results/depth<number>.png"),
        ("monosdf", "depth", "the layout monosdf reads no depth maps from files"),
        ("sdfstudio", "masks", "as foreground_mask"),
        ("tum", "depth_raw", "in depth.txt"),
    ],
)
def test_what_would_help_is_what_the_layout_reads(written, settings_of, name, folder, words):
    root = written(name)
    touched(root / folder / "left.png", root / folder / "right.png")
    scene = read_scene(settings_of(root, name))
    assert any(f"{folder} has 2 files" in said and words in said for said in (*scene.warnings, *scene.notes))
