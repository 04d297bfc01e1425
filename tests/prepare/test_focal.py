"""The focal length of photos without poses: how sure it is, what is done where the photos do not determine it."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from room2dgs import cli
from room2dgs.colmap import pycolmap
from room2dgs.prepare.features import new_database, set_focal
from room2dgs.prepare.focal import (
    LENS_SIGMA,
    WEAK,
    Focal,
    focal_doubt,
    focal_from_dict,
    focal_line,
    is_determined,
    measured_focal,
    turn_deg,
    weighed,
)
from room2dgs.prepare.focal_by_edges import focal_by_edges
from room2dgs.prepare.focal_uncertainty import lens_estimate
from room2dgs.prepare.metres import Scale
from room2dgs.prepare.photos import ChosenPhoto
from room2dgs.prepare.starts import Start, best_start, chosen
from room2dgs.prepare.verdict import scale_doubt

SIZE, TRUE_F = (640, 480), 600.0
NOISE_PX = 0.5


def reconstruction(
    turning: bool, seed: int = 0, noise: float = NOISE_PX, f: float = TRUE_F, views: int = 8
) -> pycolmap.Reconstruction:
    """Cameras along a line that see a heap of points, each with its noise; they look at its middle, or straight on."""
    random = np.random.default_rng(seed)
    points = random.uniform([-1.2, -0.8, 2.0], [1.2, 0.8, 4.0], (60, 3))
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(
        pycolmap.Camera(model="SIMPLE_RADIAL", width=640, height=480, params=[f, 320, 240, 0.0], camera_id=1)
    )
    seen = []
    for index, x in enumerate(np.linspace(-0.6, 0.6, views)):
        eye = np.array([x, 0.2 * np.sin(4 * x), 0.1 * np.cos(5 * x)])
        forward = np.array([0.0, 0, 3]) - eye if turning else np.array([0.0, 0, 1])
        forward /= np.linalg.norm(forward)
        right = np.cross([0.0, 1, 0], forward)
        right /= np.linalg.norm(right)
        turn = np.stack([right, np.cross(forward, right), forward])
        in_cam = (points - eye) @ turn.T
        pixel = in_cam[:, :2] / in_cam[:, 2:] * f + [320, 240]
        pixel += random.normal(0, noise, pixel.shape) if noise else 0
        image = pycolmap.Image(name=f"{index}.jpg", keypoints=pixel, camera_id=1, image_id=index + 1)
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(np.c_[turn, -turn @ eye]))
        seen.append(pixel)
    for point, xyz in enumerate(points):
        track = pycolmap.Track()
        for index in range(views):
            track.add_element(index + 1, point)
        model.add_point3D(xyz, track)
    return adjusted(model)


def adjusted(model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """By the lens, poses and points."""
    options, config = pycolmap.BundleAdjustmentOptions(), pycolmap.BundleAdjustmentConfig()
    options.print_summary = False
    for image_id in model.reg_image_ids():
        config.add_image(image_id)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    pycolmap.create_default_bundle_adjuster(options, config, model).solve()
    model.update_point_3d_errors()
    return model


def photos(focal_px: float | None = None) -> list[ChosenPhoto]:
    return [ChosenPhoto(f"{index}.jpg", SIZE, focal_px, None, index, 1.0) for index in range(8)]


def test_the_covariance_is_what_repeated_noise_does_to_the_lens():
    found = [lens_estimate(reconstruction(True, seed)) for seed in range(40)]
    values = np.array([one.values for one in found])
    said = np.sqrt(np.mean([np.diag(one.covariance) for one in found], axis=0))
    # the principal point, which is not adjusted here, is free in the covariance: it may only say more
    assert (values.std(axis=0) < 1.25 * said).all() and (said < 2.5 * values.std(axis=0)).all()
    assert abs(np.exp(values[:, 0].mean()) / TRUE_F - 1) < 3 * said[0] / np.sqrt(40)


def test_noise_counts_and_so_does_the_number_of_photos():
    one = measured_focal(reconstruction(True), photos())
    noisy = measured_focal(reconstruction(True, noise=2 * NOISE_PX), photos())
    assert noisy.sigma == pytest.approx(2 * one.sigma, rel=0.25)
    assert measured_focal(reconstruction(True, views=16), photos()).sigma < one.sigma


def test_cameras_that_never_turn_do_not_determine_the_focal_length():
    still, turning = reconstruction(False), reconstruction(True)
    found, good = measured_focal(still, photos()), measured_focal(turning, photos())
    assert found.sigma > 5 * good.sigma and found.sigma > LENS_SIGMA
    assert not is_determined(found, still) and turn_deg(still) < 1 and turn_deg(turning) > 15


def test_what_the_photos_determine_is_kept_and_what_they_do_not_becomes_likely():
    sure = reconstruction(True, noise=0.05)
    before = measured_focal(sure, photos())
    after = weighed(sure, before)
    assert before.sigma < WEAK and after.px == pytest.approx(before.px, rel=2e-3) and not after.weak
    assert sure.camera(1).params[0] == pytest.approx(after.px)
    unsure = reconstruction(False)
    camera = unsure.camera(1)
    camera.params = [1500.0, 320, 240, 0.0]
    unsure = adjusted(unsure)  # goes nearly nowhere, as nothing tells it to
    wrong = measured_focal(unsure, photos())
    after = weighed(unsure, wrong)
    likely = 0.85 * SIZE[0]
    assert abs(np.log(after.px / likely)) < 0.5 * abs(np.log(wrong.px / likely))
    assert after.weak and after.sigma <= LENS_SIGMA + 1e-9
    assert unsure.compute_mean_reprojection_error() < 3 * NOISE_PX  # poses and points went along
    assert unsure.camera(1).params[0] == pytest.approx(after.px)


def test_a_focal_length_in_the_exif_weighs_more_than_what_lenses_usually_have():
    model = reconstruction(False)
    found = weighed(model, measured_focal(model, photos(700.0)))
    assert found.exif == 700.0 and not found.weak
    assert abs(found.px / 700 - 1) < 0.1 and found.sigma <= 0.1 + 1e-9


def test_starts_that_fit_alike_make_it_less_sure_and_the_likeliest_is_taken():
    model = reconstruction(True)
    focal = measured_focal(model, photos())
    few = reconstruction(True, views=4)
    starts = [Start(model, [], 0, replace(focal, px=px)) for px in (1400.0, 560.0, 200.0)]
    best, alike = chosen([*starts, Start(few, [], 0, replace(focal, px=0.85 * SIZE[0]))])
    assert best is starts[1] and alike == [starts[0], starts[2]]  # the one with less support does not count
    after = weighed(model, best.focal, None, [one.focal.px for one in alike])
    assert 0.2 < after.sigma < LENS_SIGMA and after.starts == (1400.0, 200.0)
    assert "from 200 to 1400 px fit the photos alike" in focal_doubt(after, SIZE, 30.0)


def test_other_starts_are_tried_only_where_the_first_does_not_determine_it(tmp_path):
    (tmp_path / "work").mkdir()
    database = tmp_path / "a.db"
    for photo in photos():
        cv2.imwrite(str(tmp_path / photo.name), np.full((480, 640), 99, np.uint8))

    def tried(*models: pycolmap.Reconstruction | None) -> tuple[list[float], Start | None]:
        from room2dgs.config import load_config

        config = load_config(["prepare.images=unused", "scene.path=unused", "out=unused"]).prepare
        new_database(database, photos(), config, None, True)
        given, left = [], list(models)

        def mapping() -> list[pycolmap.Reconstruction]:
            with pycolmap.Database.open(database) as opened:
                given.append(opened.read_all_cameras()[0].params[0] / SIZE[0])
            model = left.pop(0)
            return [] if model is None else [pycolmap.Reconstruction(model)]

        return given, best_start(mapping, photos(), database, tmp_path, tmp_path / "work", False, lambda line: None)

    sure, unsure = reconstruction(True, noise=0.05), reconstruction(False)
    given, best = tried(sure)
    assert given == [0.85] and best.focal.sigma < WEAK
    given, best = tried(unsure, unsure, None, unsure)
    assert given == pytest.approx([0.85, 0.6, 1.1, 1.6]) and best.focal.weak and len(best.focal.starts) == 2
    assert tried(None, None, None, None)[1] is None
    assert tried(None, sure, None, None)[1].focal.px == pytest.approx(TRUE_F, rel=0.02)


def test_starts_leave_what_the_exif_tells(tmp_path):
    from room2dgs.config import load_config

    config = load_config(["prepare.images=unused", "scene.path=unused", "out=unused"]).prepare
    known = ChosenPhoto("known.jpg", SIZE, 500.0, None, 9, 1.0)
    new_database(tmp_path / "a.db", [*photos(), known], config, None, True)
    set_focal(tmp_path / "a.db", [*photos(), known], 1.1)
    with pycolmap.Database.open(tmp_path / "a.db") as opened:
        assert sorted(camera.params[0] for camera in opened.read_all_cameras()) == pytest.approx([500.0, 704.0])


def test_the_verdict_says_how_sure_the_focal_length_is():
    weak = Focal(1035.0, 0.27, 0.5, None, None, (240.0,))
    assert focal_line(Focal(615.0, 0.012, 0.012)) == "focal length 615 px +-1.2%"
    assert focal_line(Focal(615.0)) == "focal length 615 px, as given"
    said = focal_doubt(weak, SIZE, 2.0)
    assert "1035 px +-27%; from 240 to 1035 px" in said and "scene.intrinsics=[FX,FY,320,240]" in said
    assert "always looks the same way" in said and "always looks" not in focal_doubt(weak, SIZE, 40.0)
    assert focal_doubt(Focal(615.0, 0.012, 0.012), SIZE, 2.0) is None
    assert focal_doubt(Focal(615.0), SIZE, 2.0) is None
    assert focal_from_dict(json.loads(json.dumps(weak.as_dict()))) == weak


def in_a_room(eye: np.ndarray, turn: np.ndarray, f: float, random: np.random.Generator, square: bool) -> np.ndarray:
    """A photo of the edges of boxes; of sticks in any direction if not `square`."""
    picture = np.full((480, 640, 3), 200, np.uint8)
    for _ in range(12):
        low, size = random.uniform([-1.5, -1.0, 2.2], [1.0, 0.6, 3.5]), random.uniform(0.3, 1.0, 3)
        sides = np.diag(size) if square else random.normal(0, 0.4, (3, 3))
        for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            for i in (0, 1):
                start = low + i * sides[b] + random.integers(2) * sides[c]
                ends = (np.stack([start, start + sides[a]]) - eye) @ turn.T
                if ends[:, 2].min() > 0.5:
                    pixel = ends[:, :2] / ends[:, 2:] * f + [320, 240] - 0.5
                    one, other = np.round(16 * pixel).astype(int)
                    cv2.line(picture, tuple(one.tolist()), tuple(other.tolist()), (30, 30, 30), 2, cv2.LINE_AA, 4)
    return picture


@pytest.mark.parametrize("square", [True, False])
def test_edges_of_a_room_tell_the_focal_length_of_cameras_that_never_turn(tmp_path, square):
    model = reconstruction(False)
    turn = cv2.Rodrigues(np.array([0.25, 0.5, 0.1]))[0]  # so that no edge is parallel to the picture
    for index in range(8):
        pose = model.image(index + 1).cam_from_world()
        eye = -pose.rotation.matrix().T @ pose.translation + [0.0, 0.0, 1.0]
        photo = in_a_room(turn.T @ eye, turn, TRUE_F, np.random.default_rng(3), square)
        cv2.imwrite(str(tmp_path / f"{index}.jpg"), photo)
    camera = model.camera(1)
    camera.params = [450.0, 320, 240, 0.0]
    found = focal_by_edges(model, tmp_path)
    if square:
        assert 450 * np.exp(found.log_ratio) == pytest.approx(TRUE_F, rel=0.05) and found.sigma < 0.1
        after = weighed(model, replace(measured_focal(model, photos()), px=450.0), tmp_path)
        assert after.px == pytest.approx(TRUE_F, rel=0.06) and after.edges == pytest.approx(TRUE_F, rel=0.05)
    else:
        assert found is None or found.sigma > 0.15


def test_photos_that_contradict_each_other_on_the_scale_are_doubted():
    bent = Scale(1.0, "network", 0.3, 30, "", 4.0)
    assert re.search(r"by 4\.0 times .*scene\.intrinsics", scale_doubt(bent))
    assert scale_doubt(replace(bent, ratio=1.3)) is None and scale_doubt(replace(bent, ratio=None)) is None
    assert scale_doubt(None) is None


@pytest.mark.slow
def test_intrinsics_that_are_given_are_held_and_a_slide_along_a_wall_is_doubted(corner_walk, tmp_path, capsys):
    places = np.linspace(-0.35, 0.35, 8)
    eyes = [np.array([1.7 + x, 1.7 - x, 1.2 + 0.05 * np.sin(9 * x)]) for x in places]
    walk = corner_walk(eyes, [eye - [1.4, 1.4, 0.8] for eye in eyes])
    source = tmp_path / "photos"
    source.mkdir()
    for index, (_, photo) in enumerate(walk):
        cv2.imwrite(str(source / f"{index}.png"), photo[..., ::-1])
    quick = [f"images={source}", "prepare.features=500", "prepare.length=[1.0]", "prepare.threads=1"]
    assert cli.main(["prepare", f"out={tmp_path / 'free'}", *quick]) == 0
    verdict = json.loads((tmp_path / "free/prepare.json").read_text())
    assert verdict["focal"]["sigma"] > WEAK and "do not determine the focal length" in verdict["warnings"][0]
    assert "nothing has to be filmed again" not in capsys.readouterr().out
    given = "scene.intrinsics=[260,260,160,120]"
    assert cli.main(["prepare", f"out={tmp_path / 'held'}", given, *quick]) == 0
    verdict = json.loads((tmp_path / "held/prepare.json").read_text())
    (camera,) = pycolmap.Reconstruction(tmp_path / "held/sparse/0").cameras.values()
    assert list(camera.params) == [260, 260, 160, 120] and verdict["warnings"] == []
    assert "focal length 260 px, as given" in capsys.readouterr().out
