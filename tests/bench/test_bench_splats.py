"""`room2dgs bench splats`: curves of our methods, and another program's results on the same axes."""

from __future__ import annotations

import csv
import json

import cv2
import numpy as np
import pytest
import torch
from pandas import read_csv

from room2dgs import cli
from room2dgs.bench import splats
from room2dgs.bench.splats_other import other_points, parsed, read_gaussians
from room2dgs.captures.read import read_scene
from room2dgs.commands.bench_splats import chosen_methods, chosen_seconds
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.export.gaussian_ply import gaussian_ply
from room2dgs.pipeline.surfels import render_frames
from room2dgs.splat import Gaussians


@pytest.fixture
def config(capture):
    return load_config([f"scene.path={capture}", "out=unused", "scene.test_every=3"])


@pytest.fixture
def gaussians():
    g = torch.Generator().manual_seed(2)
    centers = torch.randn(300, 3, generator=g)
    scales = 0.02 + 0.1 * torch.rand(300, 3, generator=g)
    rotations = torch.nn.functional.normalize(torch.randn(300, 4, generator=g), dim=1)
    sh = 0.3 * torch.randn(300, 9, 3, generator=g)
    return Gaussians(centers, rotations, scales, 0.1 + 0.8 * torch.rand(300, generator=g), sh)


def test_the_command_trains_each_method_and_writes_curves(capture, tmp_path, capsys, monkeypatch):
    class Here:  # of a ProcessPoolExecutor: in this process, which has the modules loaded
        def __init__(self, *args, **options):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *error):
            return None

        def submit(self, function, *args):
            found = function(*args)
            return type("Done", (), {"result": lambda self: found})()

    monkeypatch.setattr(splats, "ProcessPoolExecutor", Here)
    out = tmp_path / "bench"
    settings = ["train.iterations=30", "scene.test_every=3", "train.tensorboard=false", "render.threads=1"]
    command = ["bench", "splats", str(capture), f"out={out}", "methods=3d,3d_mcmc", "seconds=0.001", *settings]
    assert cli.main(command) == 0
    assert "3d_mcmc" in capsys.readouterr().out
    rows = list(csv.DictReader((out / "bench_splats.csv").open()))
    assert [row["method"] for row in rows] == ["3d", "3d", "3d_mcmc", "3d_mcmc"]  # at the mark, and at the end
    for first, last in (rows[:2], rows[2:]):
        assert int(first["iteration"]) < int(last["iteration"]) == 30
        assert float(first["seconds"]) < float(last["seconds"]) and float(last["cpu_seconds"]) > 0
        assert float(last["psnr_db"]) > 5 and int(last["primitives"]) > 0
    figures = json.loads((out / "bench_splats.json").read_text())
    assert len(figures["points"]) == 4 and figures["command"].startswith("room2dgs bench splats")
    assert "data:image/jpeg" in (out / "bench_splats.html").read_text()
    assert len(read_csv(out / "bench_splats.csv")) == 4
    assert (out / capture.name / "3d" / "surfels.safetensors").exists()


@pytest.fixture
def theirs(tmp_path):
    (tmp_path / "theirs").mkdir()
    return tmp_path / "theirs"


def test_gaussians_of_a_file_are_those_that_were_written(gaussians, tmp_path):
    path = tmp_path / "one.ply"
    path.write_bytes(gaussian_ply(gaussians))
    for name, found, written in zip(Gaussians._fields, read_gaussians(path), gaussians, strict=True):
        torch.testing.assert_close(found, written, atol=1e-5, rtol=1e-5, msg=name)
    moved = read_gaussians(path, (1.0, -2.0, 0.5))
    torch.testing.assert_close(moved.centers, gaussians.centers - torch.tensor([1.0, -2.0, 0.5]))


def test_another_programs_files_and_pictures_have_one_score(config, gaussians, theirs):
    """The same Gaussians, as a file and as pictures of them; the photos themselves are perfect."""
    scene = read_scene(config.scene)
    (theirs / "30.ply").write_bytes(gaussian_ply(gaussians))
    for folder in ("60", "photos"):
        (theirs / folder).mkdir()
    for frame, view in render_frames(gaussians, scene.test, config):
        picture = np.round(view.color.clamp(0, 1).numpy() * 255).astype(np.uint8)
        cv2.imwrite(str(theirs / "60" / f"{frame.name}.png"), picture[..., ::-1])
        cv2.imwrite(str(theirs / "photos" / f"{frame.name}.png"), frame.color()[..., ::-1])
    found = other_points(parsed(f"theirs:{theirs}"), "room", scene, config)
    assert [point.seconds for point in found] == [30.0, 60.0, None]
    of_file, of_pictures, of_photos = found
    assert of_file.primitives == 300 and of_pictures.primitives is None
    assert of_pictures.psnr_db == pytest.approx(of_file.psnr_db, abs=0.05)
    assert of_photos.psnr_db == 100 and of_photos.ssim == pytest.approx(1)
    assert {point.method for point in found} == {"theirs"}


def test_results_that_cannot_be_scored_are_named(config, gaussians, theirs):
    scene = read_scene(config.scene)
    other = parsed(f"theirs:{theirs}")
    with pytest.raises(InputError, match=r"neither pictures nor \.ply"):
        other_points(other, "room", scene, config)
    (theirs / "30").mkdir()
    with pytest.raises(InputError, match=f"no picture of the held-out view {scene.test[0].name}"):
        other_points(other, "room", scene, config)
    cv2.imwrite(str(theirs / "30" / f"{scene.test[0].name}.png"), np.zeros((3, 4, 3), np.uint8))
    with pytest.raises(InputError, match="4 x 3, but the run works at"):
        other_points(other, "room", scene, config)
    (theirs / "30" / f"{scene.test[0].name}.png").write_bytes(b"nothing")
    with pytest.raises(InputError, match="cannot be decoded"):
        other_points(other, "room", scene, config)
    lacking = gaussian_ply(gaussians).replace(b"property float scale_2", b"property float other_2")
    (theirs / "a.ply").write_bytes(lacking)
    with pytest.raises(InputError, match="has no scale_2"):
        read_gaussians(theirs / "a.ply")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["methods=4d"], "methods=4d is not known; choose from 2d, "), (["seconds=0,30"], "seconds=0,30 is not"),
        (["seconds=soon"], "seconds=soon is not understood"), (["other=theirs"], "write other=NAME:DIR"),
        (["other=theirs:nowhere"], "nowhere is no folder"), (["scene.test_every=0"], "no view is held out"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_said_before_anything_is_trained(capture, tmp_path, capsys, arguments, sentence):
    assert cli.main(["bench", "splats", str(capture), f"out={tmp_path / 'out'}", *arguments]) == 2
    assert sentence in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_words_of_the_command():
    assert chosen_methods(None) == list(splats.DEFAULT_METHODS) and chosen_methods("none") == []
    assert chosen_seconds("60,30,60") == [30.0, 60.0]
    for settings, _ in splats.METHODS.values():
        load_config([*settings, "scene.path=x", "out=y"])
