"""Metashape's cameras.xml: of several calibrations, cameras, chunks and components the right one, or a word."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from room2dgs.captures.lens import Lens
from room2dgs.captures.read import read_scene
from room2dgs.captures.readers.metashape_lens import sensor_lens
from room2dgs.errors import InputError

ADJUSTED = '<calibration type="frame" class="adjusted">'
INITIAL = (
    '<calibration type="frame" class="initial"><resolution width="96" height="72"/><f>75.6</f><k1>-0.05</k1>'
    "</calibration>"
)


@pytest.fixture
def changed(written, tmp_path):
    """`changed(change)` writes the capture and lets `change` give other text of its cameras.xml."""

    def write(change):
        shutil.rmtree(tmp_path / "metashape", ignore_errors=True)
        root = written("metashape")
        path = root / "cameras.xml"
        path.write_text(change(path.read_text()))
        return root

    return write


def check_right(scene, made, count: int = 6) -> None:
    assert len(scene.frames) == count
    for frame in scene.frames:
        np.testing.assert_allclose(frame.camera.K, made.K, atol=1e-9)
        index = int(frame.name.rpartition("_")[2]) - 8
        np.testing.assert_allclose(frame.camera.world_from_cam, made.poses[index], atol=1e-9)


@pytest.mark.parametrize("first", [True, False])
def test_the_adjusted_calibration_wins_wherever_it_stands(changed, settings, made, first):
    def change(text):
        if first:
            return text.replace(ADJUSTED, INITIAL + ADJUSTED)
        return text.replace("</calibration>", "</calibration>" + INITIAL)

    check_right(read_scene(settings(changed(change))), made)


def test_several_adjusted_calibrations_are_told_and_an_initial_one_alone_too(changed, settings, made):
    other = INITIAL.replace("initial", "adjusted")
    scene = read_scene(settings(changed(lambda text: text.replace(ADJUSTED, other + ADJUSTED))))
    check_right(scene, made)
    assert any("2 adjusted calibrations (f=75.6, 84" in line for line in scene.warnings)
    scene = read_scene(settings(changed(lambda text: text.replace("adjusted", "initial"))))
    check_right(scene, made)
    assert any("initial calibration alone" in line for line in scene.warnings)


def test_the_calibration_s_own_resolution_tells_where_its_middle_is(changed, settings, made):
    """The sensor's was of larger photos."""

    def change(text):
        return text.replace('<resolution width="96" height="72"/>', '<resolution width="192" height="144"/>', 1)

    check_right(read_scene(settings(changed(change))), made)


@pytest.mark.parametrize(
    "element",
    [
        '<camera id="99"><rotation_covariance/></camera>',
        '<camera id="99" sensor_id="0"><transform>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</transform></camera>',
        '<camera id="99" sensor_id="77" label="IMG_99"/>',
        '<group id="0" label="other"><camera id="99"/></group>',
    ],
)
def test_cameras_without_label_or_photo_are_passed_over(changed, settings, made, element):
    scene = read_scene(settings(changed(lambda text: text.replace("</cameras>", f"{element}</cameras>"))))
    check_right(scene, made)
    assert any("passed over: 1 cameras" in note for note in scene.notes) == ('label="IMG' not in element)


@pytest.mark.parametrize("word", ["false", "0"])
def test_disabled_cameras_are_left_out(changed, settings, made, word):
    scene = read_scene(
        settings(changed(lambda text: text.replace('<camera id="2"', f'<camera enabled="{word}" id="2"')))
    )
    check_right(scene, made, 5)
    assert any("1 cameras that are disabled" in note for note in scene.notes)


def camera(text: str, number: int) -> str:
    return re.search(rf'<camera id="{number}".*?</camera>', text)[0]


def test_of_two_cameras_of_one_photo_the_aligned_one_is_taken(changed, settings, made):
    extra = '<camera id="98" sensor_id="0" component_id="0" label="IMG_9"/>'
    for place in ("<cameras>", "</cameras>"):
        new = f"{place}{extra}" if place == "<cameras>" else f"{extra}{place}"
        check_right(read_scene(settings(changed(lambda text, place=place, new=new: text.replace(place, new)))), made)


def test_two_poses_of_one_photo_leave_it_out_by_name(changed, settings, made):
    def change(text):
        return text.replace("</cameras>", camera(text, 4).replace("IMG_12", "IMG_9") + "</cameras>")

    scene = read_scene(settings(changed(change)))
    check_right(scene, made, 5)
    assert any("whose photo is not clear" in line and "IMG_9" in line for line in scene.warnings)


def test_many_photos_with_two_poses_are_refused(changed, settings):
    def change(text):
        more = "".join(camera(text, 5).replace("IMG_13", f"IMG_{number}") for number in (8, 9, 10))
        return text.replace("</cameras>", more + "</cameras>")

    with pytest.raises(InputError, match=r"2 cameras called 'IMG_8' with different poses"):
        read_scene(settings(changed(change)))


def two_folders(root, made) -> None:
    """left/0000 .. and right/0000 .. in place of the photos, whose labels are alike."""
    path = root / "cameras.xml"
    text = path.read_text()
    for index in range(made.count):
        folder = root / "images" / ("left" if index < 3 else "right")
        folder.mkdir(exist_ok=True)
        (root / f"images/IMG_{index + 8}.JPG").rename(folder / f"{index % 3:04d}.JPG")
        text = text.replace(f'label="IMG_{index + 8}"', f'label="{folder.name}/{index % 3:04d}"')
    path.write_text(text)


def test_labels_with_folders_find_photos_of_one_name(written, settings, made):
    root = written("metashape")
    two_folders(root, made)
    frames = read_scene(settings(root)).frames
    assert [frame.name for frame in frames] == [f"{side}_{i:04d}" for side in ("left", "right") for i in range(3)]
    for frame, pose in zip(frames, made.poses, strict=True):
        np.testing.assert_allclose(frame.camera.world_from_cam, pose, atol=1e-9)


def test_labels_alike_are_told_apart_by_the_paths_of_a_project_or_refused(written, settings, made):
    root = written("metashape")
    two_folders(root, made)
    path = root / "cameras.xml"
    plain = re.sub(r'label="(left|right)/', 'label="', path.read_text())
    path.write_text(plain)
    with pytest.raises(InputError, match=r"camera '0000' may be of left/0000\.JPG, right/0000\.JPG"):
        read_scene(settings(root))
    photos = "".join(
        f'<camera camera_id="{i}"><photo path="D:\\flight\\{"left" if i < 3 else "right"}\\{i % 3:04d}.JPG"/></camera>'
        for i in range(made.count)
    )
    frames = f'<frames><frame id="0"><cameras>{photos}</cameras></frame></frames>'
    path.write_text(plain.replace("</cameras></chunk>", f"</cameras>{frames}</chunk>"))
    for frame, pose in zip(read_scene(settings(root)).frames, made.poses, strict=True):
        np.testing.assert_allclose(frame.camera.world_from_cam, pose, atol=1e-9)


def test_of_several_chunks_the_one_with_most_aligned_cameras_is_read(changed, settings, made):
    def change(text):
        small = re.sub(
            r"<transform>[^<]*</transform></camera>", "</camera>", re.search(r"<chunk.*</chunk>", text)[0], count=3
        )
        return text.replace("<chunk", small.replace("Chunk 1", "Small") + "<chunk", 1)

    scene = read_scene(settings(changed(change)))
    check_right(scene, made)
    assert any("2 chunks: Chunk 1 is read" in note for note in scene.notes)


def test_components_that_are_placed_share_one_unit(changed, settings, made):
    """A second component at half the scale: its cameras' own numbers are twice as large."""

    def change(text):
        component = re.search(r'<component id="0">.*?</component>', text)[0]
        other = component.replace('id="0"', 'id="1"').replace("<scale>2</scale>", "<scale>1</scale>")
        text = text.replace("</components>", other + "</components>")
        for number in (4, 5):
            old = camera(text, number)
            values = np.array(re.search(r"<transform>(.*)</transform>", old)[1].split(), float).reshape(4, 4)
            values[:3, 3] *= 2
            new = re.sub(
                r"<transform>.*</transform>",
                f"<transform>{' '.join(map(repr, values.ravel().tolist()))}</transform>",
                old,
            )
            text = text.replace(old, new.replace('component_id="0"', 'component_id="1"'))
        return text

    check_right(read_scene(settings(changed(change))), made)


def test_components_that_are_not_placed_are_left_out(changed, settings, made):
    def change(text):
        text = text.replace("</components>", '<component id="1"/></components>')
        return text.replace(camera(text, 5), camera(text, 5).replace('component_id="0"', 'component_id="1"'))

    scene = read_scene(settings(changed(change)))
    check_right(scene, made, 5)
    assert any("2 components that are not placed" in line and "1 cameras" in line for line in scene.warnings)
    assert [one.name for one in scene.dropped] == ["IMG_13"]


@pytest.mark.parametrize(
    ("numbers", "said"),
    [("<k4>0.01</k4>", "k4"), ("<p3>0.01</p3>", "p3"), ("<b2>3</b2>", "skewed"), ("<k5>0.1</k5>", None)],
)
def test_numbers_that_are_not_read_are_refused_or_named(changed, settings, numbers, said):
    root = changed(lambda text: text.replace("</calibration>", f"{numbers}</calibration>"))
    if said:
        with pytest.raises(InputError, match=said):
            read_scene(settings(root))
    else:
        assert any("k5" in line for line in read_scene(settings(root)).warnings)


def test_a_sensor_that_no_aligned_camera_has_costs_nothing(changed, settings, made):
    other = (
        '<sensor id="5" type="spherical"><resolution width="9" height="9"/><calibration><f>1</f></calibration></sensor>'
    )
    check_right(read_scene(settings(changed(lambda text: text.replace("</sensors>", f"{other}</sensors>")))), made)


def lens(kind: str, numbers: str) -> Lens:
    text = f'<sensor type="{kind}"><calibration><resolution width="100" height="80"/>{numbers}</calibration></sensor>'
    return sensor_lens(ElementTree.fromstring(text), "x", lambda line: None)


def test_a_fisheye_s_tangential_terms_are_read_in_opencv_s_order():
    numbers = "<f>50</f><k1>.1</k1><k2>.2</k2><k3>.3</k3><k4>.4</k4>"
    assert lens("fisheye", numbers).params == (50, 50, 50, 40, 0.1, 0.2, 0.3, 0.4)
    found = lens("equidistant_fisheye", numbers + "<p1>.01</p1><p2>.02</p2>")
    assert (found.model, found.params) == (
        "THIN_PRISM_FISHEYE", (50, 50, 50, 40, 0.1, 0.2, 0.02, 0.01, 0.3, 0.4, 0, 0)
    )  # fmt: skip


def test_a_fisheye_with_tangential_terms_projects_as_the_manual_says():
    found = lens("fisheye", "<f>50</f><k1>.1</k1><k2>-.02</k2><p1>.003</p1><p2>-.004</p2>")
    ray = np.array([0.7, -0.4, 1.0])
    theta = np.arctan(np.hypot(*ray[:2]))
    x, y = ray[:2] / np.hypot(*ray[:2]) * theta
    r2 = x * x + y * y
    radial = 1 + 0.1 * r2 - 0.02 * r2**2
    moved = (
        x * radial + 0.003 * (r2 + 2 * x * x) + 2 * -0.004 * x * y,
        y * radial + -0.004 * (r2 + 2 * y * y) + 2 * 0.003 * x * y,
    )
    np.testing.assert_allclose(found.project(ray[None])[0], np.array(moved) * 50 + (50, 40), atol=1e-9)


def test_the_first_form_s_focal_lengths_count_from_the_corner():
    assert lens("frame", "<fx>50</fx><fy>51</fy><cx>48</cx><cy>39</cy>").K.tolist() == [
        [50, 0, 48], [0, 51, 39], [0, 0, 1]
    ]  # fmt: skip


def test_photos_that_are_not_there_are_left_out(written, settings, made):
    root = written("metashape")
    (root / "images/IMG_9.JPG").unlink()
    scene = read_scene(settings(root))
    check_right(scene, made, 5)
    assert "IMG_9.JPG is missing" in scene.dropped[0].reason
    shutil.rmtree(root / "images")
    with pytest.raises(InputError, match="is missing"):
        read_scene(settings(root))


def test_one_camera_with_a_bad_pose_costs_itself(changed, settings, made):
    scene = read_scene(settings(changed(lambda text: re.sub(r'(label="IMG_8"><transform>)\S+ ', r"\1", text))))
    check_right(scene, made, 5)
    assert [one.name for one in scene.dropped] == ["IMG_8"] and "15 numbers" in scene.dropped[0].reason


def test_distortion_is_opencv_s(written, settings, made):
    root = written("metashape", made=replace(made))
    path = root / "cameras.xml"
    path.write_text(path.read_text().replace("</calibration>", "<k1>0.05</k1><p1>.001</p1></calibration>"))
    found = read_scene(settings(root)).frames[0].lens
    assert found.model == "FULL_OPENCV" and found.params[4:8] == (0.05, 0.0, 0.0, 0.001)
