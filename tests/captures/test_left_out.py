"""One bad item of many costs itself and not the capture; links out of a capture are named."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.captures.left_out import left_out
from room2dgs.captures.read import placed, read_scene
from room2dgs.errors import InputError


def photos_of(root: Path) -> list[Path]:
    return sorted((root / "images").rglob("*.*"), key=lambda path: int("".join(filter(str.isdigit, path.stem))))


@pytest.fixture
def fox(written, settings, made):
    """`fox(count, gone)` writes a COLMAP capture of which some photos are missing, and gives its settings and names."""

    def write(gone: list[int]):
        root = written("colmap")
        photos = photos_of(root)
        for index in gone:
            photos[index].unlink()
        return settings(root), photos

    return write


def test_missing_photos_are_left_out_and_the_others_stay_what_they_are(fox, made):
    config, photos = fox([1, 4])
    scene = read_scene(config)
    left = [index for index in range(6) if index not in (1, 4)]
    for frame, index in zip(scene.frames, left, strict=True):
        np.testing.assert_allclose(frame.camera.world_from_cam, made.poses[index], atol=1e-9)
        assert frame.index == index
    assert [line for line in scene.warnings if photos[1].name in line and "2 of 6" in line]
    assert all("is missing" in one.reason for one in scene.dropped)
    points = scene.given_points()
    assert points.tracks.frames == tuple(frame.name for frame in scene.train)
    for frame, index in zip(scene.train, left, strict=True):
        assert len(points.tracks.of_frame(frame.name)[0]) == len(made.seen[index][0])
    assert [frame.name for frame in placed(config).frames] == [frame.name for frame in scene.frames]


def test_more_than_half_missing_is_a_sentence(fox):
    config, _ = fox([1, 2, 3, 4])
    with pytest.raises(InputError, match=r"is missing.*the first of 4 photos that are missing, of 6"):
        read_scene(config)


def test_a_missing_photo_in_transforms_json_costs_itself(written, settings):
    root = written("nerfstudio")
    (root / "images/frame_00010.png").unlink()
    scene = read_scene(settings(root))
    assert len(scene.frames) == 5 and "frame_00010.png" in " ".join(scene.warnings)


def test_a_held_out_photo_may_be_the_bad_one(written, settings):
    root = written("nerfstudio")
    known = json.loads((root / "transforms.json").read_text())
    names = sorted(frame["file_path"] for frame in known["frames"])
    known["test_filenames"] = names[2:4]
    (root / "transforms.json").write_text(json.dumps(known))
    (root / names[2]).write_bytes((root / names[2]).read_bytes()[:200])
    scene = read_scene(settings(root))
    assert len(scene.train) == 4 and len(scene.test) == 1
    assert len(scene.dropped) == 1 and "cannot be decoded" in scene.dropped[0].reason


def test_a_damaged_photo_costs_itself_and_its_observations(written, settings, made):
    root = written("colmap")
    photo = photos_of(root)[2]
    photo.write_bytes(photo.read_bytes()[:-300])
    scene = read_scene(settings(root))
    assert len(scene.frames) == 5 and [one.reason for one in scene.dropped if photo.name in one.reason]
    points = scene.given_points()
    assert points.tracks.frames == tuple(frame.name for frame in scene.train)
    assert points.tracks.frame.max() < 5


def test_a_damaged_photo_that_leaves_two_views_stops_the_run(written, settings):
    root = written("nerfstudio")
    known = json.loads((root / "transforms.json").read_text())
    known["frames"] = known["frames"][:3]
    (root / "transforms.json").write_text(json.dumps(known))
    path = root / known["frames"][0]["file_path"]
    path.write_bytes(path.read_bytes()[:-300])
    with pytest.raises(InputError, match="cannot be decoded"):
        read_scene(settings(root))


@given(st.integers(1, 400), st.integers(1, 400), st.sampled_from([0.05, 0.5]))
def test_the_share_that_is_borne(bad, good, most):
    named = {f"photo {index}": f"photo {index} is bad" for index in range(bad)}
    of = bad + good
    if bad > 1 and bad > most * of:
        with pytest.raises(InputError, match=rf"photo 0 is bad \(the first of {bad} photos, of {of}\)"):
            left_out(named, of, "photos", most)
    else:
        said = left_out(named, of, "photos", most)
        assert f"({bad} of {of})" in said and said.count("photo ") <= 3
    assert left_out({}, of, "photos", most) is None


@pytest.mark.parametrize("folder", [False, True])
def test_links_out_of_the_capture_are_followed_and_named_once(written, settings, tmp_path, folder):
    root = written("nerfstudio")
    before = read_scene(settings(root))
    assert not [note for note in before.notes if note.startswith("links:")]
    elsewhere = tmp_path / "elsewhere"
    shutil.move(root / "images", elsewhere)
    if folder:
        (root / "images").symlink_to(elsewhere)
    else:
        (root / "images").mkdir()
        for path in elsewhere.iterdir():
            (root / "images" / path.name).symlink_to(path)
    scene = read_scene(settings(root))
    for one, other in zip(scene.frames, before.frames, strict=True):
        np.testing.assert_array_equal(one.color(), other.color())
    found = [note for note in scene.notes if note.startswith("links:")]
    assert len(found) == 1 and "6 photos lie outside of the capture" in found[0] and str(elsewhere) in found[0]


def test_a_capture_that_is_reached_by_a_link_has_no_links_of_its_own(written, settings, tmp_path):
    root = written("nerfstudio")
    (tmp_path / "by_link").symlink_to(root)
    scene = read_scene(settings(tmp_path / "by_link"))
    assert not [note for note in scene.notes if note.startswith("links:")]


def test_links_within_the_capture_are_no_news(written, settings):
    root = written("nerfstudio")
    (root / "images").rename(root / "photos")
    (root / "images").symlink_to("photos")
    assert not [note for note in read_scene(settings(root)).notes if note.startswith("links:")]
