"""Simulated priors have the asked quality, say what they are, and appear whole or not at all."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.depth import depth_of_frames
from room2dgs.errors import InputError
from room2dgs.tools.prior_errors import image_field, turned
from room2dgs.tools.simulate_priors import PriorOptions, main, simulate_priors


@pytest.fixture(scope="module")
def made(plain, tmp_path_factory):
    out = tmp_path_factory.mktemp("priors") / "out"
    return out, simulate_priors(plain.path, out, PriorOptions(abs_rel=0.06, normal_deg=16.0, seed=5))


def written_depth(folder, index):
    return cv2.imread(str(folder / f"depth/{index}.png"), cv2.IMREAD_UNCHANGED) / 1000.0


def test_depth_has_the_asked_error_after_scale_and_shift(made, plain):
    out, measured = made
    errors = []
    for index, truth in enumerate(plain.depths):
        prior, valid = written_depth(out, index), truth > 0
        columns = np.stack([prior[valid] / truth[valid], 1.0 / truth[valid]], axis=1)
        solved = np.linalg.lstsq(columns, np.ones(valid.sum()), rcond=None)[0]
        errors.append(np.abs(columns @ solved - 1.0).mean())
    assert np.mean(errors) == pytest.approx(0.06, rel=0.15)
    assert measured["abs_rel_aligned"] == pytest.approx(np.mean(errors), abs=2e-3)
    assert measured["abs_rel"] > measured["abs_rel_aligned"]


def test_normals_are_off_by_the_asked_angle_and_face_the_camera(made, plain):
    out, measured = made
    assert measured["normal_deg"] == pytest.approx(16.0, rel=0.15)
    for index in range(3):
        normal = cv2.imread(str(out / f"normal/{index}.png"))[..., ::-1] / 127.5 - 1.0
        known = np.abs(np.linalg.norm(normal, axis=-1) - 1.0) < 0.02
        assert known.mean() > 0.5
        assert (normal * plain.rays()).sum(axis=-1)[known].max() < 0.02


def test_the_label_says_simulated(made):
    out, measured = made
    label = json.loads((out / "priors.json").read_text())
    assert (label["simulated"], label["measured"]) == (True, measured)
    assert "SIMULATED" in (out / "README.txt").read_text()


def test_the_same_options_give_the_same_bytes_and_another_seed_others(made, plain, tmp_path):
    out, _ = made
    simulate_priors(plain.path, tmp_path / "again", PriorOptions(abs_rel=0.06, normal_deg=16.0, seed=5))
    simulate_priors(plain.path, tmp_path / "other", PriorOptions(abs_rel=0.06, normal_deg=16.0, seed=6))
    files = sorted(path.relative_to(out) for path in out.rglob("*") if path.is_file())
    assert len(files) == 2 * len(plain.depths) + 2
    assert all((out / file).read_bytes() == (tmp_path / "again" / file).read_bytes() for file in files)
    assert (out / "depth/0.png").read_bytes() != (tmp_path / "other/depth/0.png").read_bytes()


def test_the_loader_takes_them_and_knows_them(made, plain):
    out, _ = made
    settings = [f"prior.depth.path={out / 'depth'}", f"prior.normal.path={out / 'normal'}"]
    config = load_config(
        [f"scene.path={plain.path}", "out=x", "scene.test_every=0", "prior=files", *settings, "prior.depth.joint=false"]
    )
    xyz = np.concatenate([plain.points(i)[::9, ::9][plain.depths[i][::9, ::9] > 0] for i in range(len(plain.depths))])
    points = PointCloud(xyz, np.zeros(xyz.shape, np.uint8))
    priors = depth_of_frames(read_scene(config.scene).train, points, config.prior, lambda line: None)
    assert priors.label == "simulated"
    assert len(priors.by_frame) == len(plain.depths)
    off = [fit.residual for fit in priors.fits.values()]
    assert np.median(off) < 0.08


def test_noise_knows_nothing_of_the_scene(plain, tmp_path):
    measured = simulate_priors(plain.path, tmp_path / "noise", PriorOptions(noise_only=True, depth_format="npy"))
    assert measured["normal_deg"] > 45.0
    assert measured["abs_rel_aligned"] > 0.15
    noise = np.load(tmp_path / "noise/depth/0.npy")
    assert abs(np.corrcoef(noise.ravel(), plain.depths[0].ravel())[0, 1]) < 0.05


def test_fields_are_smooth_with_unit_deviation():
    fields = np.stack([image_field(np.random.default_rng(seed), 60, 80, 4) for seed in range(100)])
    assert fields.std() == pytest.approx(1.0, abs=0.15)
    assert np.diff(fields, axis=2).std() < 0.2  # of white noise: 1.4


def test_turned_normals_have_the_angle_of_the_tangent_error():
    normal = np.broadcast_to((0.0, 0.0, -1.0), (4, 5, 3))
    rays = np.broadcast_to((0.0, 0.0, 1.0), (4, 5, 3))
    error = np.broadcast_to((np.tan(0.3), 0.0, 7.0), (4, 5, 3))
    np.testing.assert_allclose(turned(normal, error, rays)[0, 0], (np.sin(0.3), 0.0, -np.cos(0.3)))


@pytest.mark.parametrize(
    ("options", "said"),
    [(["--abs-rel", "nan"], "abs_rel is nan"), (["--shared", "2"], "shared is 2"), (["--depth-format", "exr"], "exr")],
)
def test_impossible_options_are_refused(plain, tmp_path, capsys, options, said):
    assert main([str(plain.path), str(tmp_path / "out"), *options]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_foreign_folder_is_not_replaced(plain, tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("years of work")
    assert main([str(plain.path), str(tmp_path), "--overwrite"]) == 2
    assert "thesis.tex" in capsys.readouterr().err
    assert (tmp_path / "thesis.tex").exists()


def test_a_capture_without_depth_is_refused(plain, tmp_path):
    for name in ("color", "pose", "intrinsic"):
        (tmp_path / "bare").mkdir(exist_ok=True)
        (tmp_path / "bare" / name).symlink_to(plain.path / name)
    with pytest.raises(InputError, match="has no depth maps"):
        simulate_priors(tmp_path / "bare", tmp_path / "out")
    assert not (tmp_path / "out").exists()
