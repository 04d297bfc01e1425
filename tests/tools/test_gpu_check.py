"""The check of a GPU, run here with other backends: it passes what is right and finds what is wrong."""

from __future__ import annotations

import json
from itertools import count

import pytest

from room2dgs.kernels.emulation import cuda_kernels_on_cpu
from room2dgs.tools.gpu_check import __main__ as gpu_check
from room2dgs.tools.gpu_check import corpus

CASE = "one pixel"
CASES = [CASE, f"{CASE}, 3D", f"{CASE}, 3D mip"]
TURN = count()
QUICK = [
    "points.source=file", "seeds.voxel_m=0.1", "train.iterations=30", "train.tensorboard=false", "prior=none",
    "mesh.voxel_m=0.05", "mesh.min_triangles=1", "eval.samples=2000",
]  # fmt: skip


@pytest.mark.slow
def test_the_whole_check(wall, tmp_path, capsys):
    path = tmp_path / "gpu.json"
    points = f"points.file={wall / 'points.ply'}"
    options = ["--backend", "cpu", "--tiny", "--only", CASE, "--json", str(path), "--room", str(wall)]
    with cuda_kernels_on_cpu():
        assert gpu_check.main([*options, points, *QUICK]) == 0
    printed = capsys.readouterr().out
    assert "demo room by cpu" in printed and "within" in printed
    found = json.loads(path.read_text())
    assert [row["case"] for row in found["corpus"]] == CASES and found["failed"] == []
    assert [row["kind"] for row in found["speed"]] == ["surfels", "Gaussians"]
    assert {row["backend"] for row in found["demo"]} == {"cpu"}
    assert all(row["f_score_5cm"] is not None and row["train_s"] > 0 and row["psnr"] > 10 for row in found["demo"])
    assert found["speed"][0]["ours"]["backward_ms"] > 0 and found["left_out"] == []


def test_nothing_is_begun_when_time_is_up(capsys):
    assert gpu_check.main(["--backend", "cpu", "--tiny", "--only", CASE, "--minutes", "0"]) == 0
    left_out = ["2000 surfels at 160x120", "2000 Gaussians at 160x120", "the demo room by cpu", *CASES]
    assert f"left out for want of time: {', '.join(left_out)}" in capsys.readouterr().out


@pytest.mark.parametrize("case", CASES[:2])
@pytest.mark.parametrize(
    "change",
    [
        lambda out: out._replace(depth=out.depth * 1.001),
        lambda out: out._replace(color=out.color.detach() + 0 * out.color),  # right images, no gradient
        lambda out: out._replace(alpha=out.alpha + 1e-6 * next(TURN)),  # within bounds, but never the same twice
    ],
    ids=["values", "gradients", "bits"],
)
def test_a_wrong_backend_is_found(change, case, monkeypatch):
    monkeypatch.setattr(corpus, "renderer", lambda backend, by: lambda *args, **more: change(by(*args, **more)))
    assert not corpus.corpus_row(case, "cpu")["passed"]


def test_a_demo_that_scores_otherwise_fails():
    def found(*scores):
        return {"corpus": [], "speed": [], "demo": [{"f_score_5cm": score} for score in scores]}

    assert gpu_check.failures(found(0.921, 0.925)) == []
    assert gpu_check.failures(found(0.921, 0.91)) == ["the demo's F-scores 0.921 and 0.910"]
    assert gpu_check.failures(found(None, 0.91)) == []


def test_a_backend_that_is_not_there_is_one_sentence(capsys):
    assert gpu_check.main(["--backend", "metal"]) == 2
    assert "no rasterizer is called 'metal'" in capsys.readouterr().err
