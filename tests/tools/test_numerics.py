"""Hard cases: the corpus of `tools/numerics` within its bounds, and new cases drawn at random."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs import splat
from room2dgs.errors import InputError
from room2dgs.losses import depth_prior
from room2dgs.primitives.gaussian3d import MipGaussians
from room2dgs.report.table import terminal
from room2dgs.splat import Gaussians
from room2dgs.tools.numerics import compare as comparing
from room2dgs.tools.numerics import tradeoff, variant_score
from room2dgs.tools.numerics.__main__ import main
from room2dgs.tools.numerics.alternatives import choices
from room2dgs.tools.numerics.compare import compare
from room2dgs.tools.numerics.gaussians import thickened
from room2dgs.tools.numerics.invariances import invariances
from room2dgs.tools.numerics.measure import ALL_SCENES
from room2dgs.tools.numerics.scenes import ILL_CONDITIONED, SCENES, HardScene, intrinsics, pose, random_surfels
from room2dgs.tools.numerics.stages import STAGES
from room2dgs.tools.numerics.terms import TERMS, compare_term
from room2dgs.tools.numerics.variants import EXACT, ROOT, VARIANTS


@pytest.fixture(autouse=True)
def one_thread():
    """Of torch: its tensors are small here."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.mark.parametrize("name", ALL_SCENES)
def test_kernels_equal_the_float64_reference(name):
    scene = ALL_SCENES[name]()
    found = compare(scene, name in ILL_CONDITIONED)
    assert found.passed, found
    assert found.left_out < 0.05  # what lies beside jumps is not compared
    still = invariances(scene)
    assert still.within(found.bound), still


@pytest.mark.parametrize("name", TERMS)
def test_terms_equal_themselves_in_float64(name):
    found = compare_term(TERMS[name])
    assert found.passed, found


@pytest.mark.parametrize("name", STAGES)
def test_stages_survive_where_there_is_nothing_to_go_by(name):
    found = STAGES[name]()
    assert found.passed, found


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    unit=st.floats(-3, 3),
    distance=st.floats(0, 5),
    size=st.floats(-3, 1),
    stretch=st.floats(0, 3),
    opacity=st.sampled_from([(0.0, 0.01), (0.01, 0.99), (0.98, 1.0)]),
    focal=st.floats(0, 3),
    angle=st.floats(0, 3.1),
    from_origin=st.sampled_from([0.0, 10.0, 1e4]),
    floor=st.sampled_from([1 / 255, 1 / 32, 0.3]),
    kind=st.sampled_from([None, Gaussians, MipGaussians]),
)
def test_cases_drawn_at_random(seed, unit, distance, size, stretch, opacity, focal, angle, from_origin, floor, kind):
    """Any unit, distance, size, shape, opacity, focal length and place, all at once; exponents of ten."""
    unit = 10.0**unit
    surfels = random_surfels(40, seed, (0.3, 1.0), distance, opacity=opacity)
    scales = surfels.scales * 10**size
    scales[:, 0] *= 10**-stretch
    turned = pose(angle, t=(0.1, -0.05, 0.2))
    away = unit * from_origin * torch.tensor([0.8, -0.6, 0.05], dtype=torch.float64)
    turned[:3, 3] = unit * turned[:3, 3] - turned[:3, :3] @ away
    centers = (unit * (surfels.centers.double() @ turned[:3, :3]) + away).float()
    K = intrinsics(10**focal, 1.1 * 10**focal, 13.3, 9.1)
    scene = HardScene(surfels._replace(centers=centers, scales=unit * scales), K, turned, 29, 19, 0.05 * unit, floor)
    found = compare(scene if kind is None else thickened(scene, seed, kind))
    assert found.passed, found


@pytest.mark.parametrize(("image", "factor"), [("depth", 1 + 3e-4), ("distortion", 0.999)])
def test_a_kernel_that_is_a_little_wrong_fails(image, factor):
    def wrong(*args, **options):
        out = splat.render(*args, **options)
        return out._replace(**{image: getattr(out, image) * factor})

    found = compare(SCENES["ordinary"](), render=wrong)
    assert not found.passed and found.finite


def test_the_chosen_forms_are_the_better_ones():
    """Needles by three planes, and the distortion of a far wall by running sums."""
    needles, far = choices(SCENES["needles"]()), choices(SCENES["at 100 m"]())
    assert 10 * needles.opacity[0] < needles.opacity[1]
    assert far.distortion[0] < 1e-5 and far.distortion[1] > 0.1


def test_rounding_does_not_push_depth_that_is_right():
    """float32's steps have signs; by the gradient term's L1 they would push as hard as real edges."""
    depth = 2 + torch.rand(30, 40, generator=torch.Generator().manual_seed(1))
    prior = (depth.double() * 0.3).float()
    leaf = depth.requires_grad_()
    ones = torch.ones(30, 40)
    depth_prior.depth_prior_loss(leaf, ones, prior, ones.bool()).backward()
    real = torch.rand(30, 40, generator=torch.Generator().manual_seed(2)) * 1e-3
    other = (depth.detach() + real).requires_grad_()
    depth_prior.depth_prior_loss(other, ones, prior, ones.bool()).backward()
    assert leaf.grad.abs().max() < 1e-4 * other.grad.abs().max()


def test_the_command_prints_writes_and_judges(tmp_path, capsys, monkeypatch):
    out, page = tmp_path / "sub" / "n.json", tmp_path / "n.md"
    command = ["--quick", "--only", "pixel", "--json", str(out), "--markdown", str(page)]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "within their bounds" in said and "commit" in said and "one pixel" in page.read_text()
    found = json.loads(out.read_text())
    cases = {f"{name}{kind}" for name in ("one pixel", "below a pixel") for kind in ("", ", 3D", ", 3D mip")}
    assert {row["case"] for row in found["raster"]} == cases
    assert found["machine"]["cores"] and found["failed"] == []
    assert found["raster"][0]["gradients"].keys() == set(comparing.GRADIENTS)

    monkeypatch.setattr(comparing, "TOLERANCE", 0.0)
    assert main([*command[:2], "one pixel"]) == 1
    assert "beyond them: one pixel" in capsys.readouterr().out
    assert main(["--only", "nonsense"]) == 2
    assert "nonsense" in capsys.readouterr().err


@pytest.mark.parametrize("variant", [EXACT, *VARIANTS], ids=lambda v: f"{v.part} {v.name}")
def test_variants_of_the_kernels_edit_what_is_there(variant):
    """A change of the sources that leaves a variant without its place would leave its row without a meaning."""
    for edit in variant.edits:
        assert (ROOT / edit.file).read_text(encoding="utf-8").count(edit.old) == 1, edit.old
    assert variant.edits or variant.isa


def test_the_tradeoffs_rows_are_errors_against_the_exact_build(tmp_path, monkeypatch):
    """Without a compiler: the "builds" are files that name a made-up result."""

    class Builder:
        def __init__(self, folder):
            folder.mkdir()

        def library(self, variant, keep):
            return tmp_path / (variant.name or "shipped")

    def run(library, out, isa):
        factor = {"none of them": 1.0, "shipped": 1.001}.get(library.name, 1.01)
        depth = torch.full((2, 3), 2.0)
        images = [factor * torch.ones(2, 3, 3), torch.ones(2, 3), factor * depth]
        torch.save({"images": images, "gradients": [factor * torch.ones(5), torch.ones(4)]}, out)
        return {"forward": factor * 2, "backward": factor * 3}

    def scored(library, env, capture, settings, out, caches):
        score = {"none of them": 0.9, "shipped": 0.8}.get(library.name, 0.7)
        assert settings == ["experiment=quick"] and out != caches
        return {"f_score_5cm": score, "f_score_2cm": score - len(capture) / 100}

    monkeypatch.setattr(tradeoff, "Builder", Builder)
    monkeypatch.setattr(tradeoff, "_run", run)
    monkeypatch.setattr(tradeoff, "scored", scored)
    rows = tradeoff.tradeoff(tmp_path / "builds", "1e-2")
    assert [row["variant"] for row in rows] == ["shipped", "1e-2"]
    assert rows[1]["forward"] == pytest.approx(1.01 / 1.001) and rows[0]["forward"] == 1
    assert [row["color"] for row in rows] == pytest.approx([0.001, 0.01], rel=1e-3)
    assert [row["depth"] for row in rows] == pytest.approx([0.001, 0.01], rel=1e-3)
    assert [row["gradient"] for row in rows] == pytest.approx([0.001, 0.01], rel=1e-3)
    assert "1e-2" in terminal(tradeoff.tradeoff_table(rows))
    scored_rows = tradeoff.tradeoff(tmp_path / "more", "1e-2", captures=["a/hall"], settings=["experiment=quick"])
    assert [row["scores"] for row in scored_rows] == [
        {"hall": (0.8, pytest.approx(0.74))}, {"hall": (0.9, pytest.approx(0.84))}, {"hall": (0.7, pytest.approx(0.64))}
    ]  # fmt: skip
    assert "0.700 (0.640)" in terminal(tradeoff.tradeoff_table(scored_rows))

    def failing(library, *rest):
        if library.name == broken:
            raise InputError("it ran out of memory")
        return scored(library, *rest)

    monkeypatch.setattr(tradeoff, "scored", failing)
    told, broken = [], "1e-2"
    rows = tradeoff.tradeoff(tmp_path / "half", "1e-2", told.append, ["a/hall"], ["experiment=quick"])
    assert [row["scores"]["hall"] is None for row in rows] == [False, False, True]
    assert "failed" in terminal(tradeoff.tradeoff_table(rows)) and "it ran out of memory" in told
    broken = "shipped"
    with pytest.raises(InputError, match="out of memory"):
        tradeoff.tradeoff(tmp_path / "none", "1e-2", captures=["a/hall"])


def test_a_variants_run_has_its_library_and_its_scores(tmp_path, monkeypatch):
    """The process is made up; a failed one is said with its last words."""
    asked = []

    def process(command, **options):
        asked.append((command, options["env"]))
        out = Path(next(text for text in command if str(text).startswith("out="))[4:])
        assert not (out / "old").exists()
        out.mkdir(parents=True)
        scores = '{"protocols": {"area": {"f_score_5cm": 0.5}}}'
        (out / "metrics.json").write_text(scores if out.name == "good" else "{}")
        return SimpleNamespace(returncode=out.name == "bad", stderr="no such room", stdout="")

    monkeypatch.setattr(variant_score.subprocess, "run", process)

    def score(name):
        return variant_score.scored(Path("_C.so"), {"X": "1"}, "hall", ["k=1"], tmp_path / name, tmp_path / "caches")

    (tmp_path / "good").mkdir()
    (tmp_path / "good" / "old").touch()
    assert score("good") == {"f_score_5cm": 0.5}
    command, env = asked[0]
    assert command[3:5] == ["_C.so", "scene.path=hall"] and command[-1] == "k=1" and env["X"] == "1"
    assert f"prior.cache={tmp_path / 'caches' / 'maps'}" in command
    with pytest.raises(InputError, match="no such room"):
        score("bad")
    with pytest.raises(InputError, match=r"scene\.gt_mesh"):
        score("without_truth")


def test_scores_are_asked_for_with_builds(capsys):
    assert main(["--score", "hall"]) == 2
    assert "--tradeoff FOLDER" in capsys.readouterr().err
    assert main(["--tradeoff", "x", "--score", "a/hall", "--score", "b/hall"]) == 2
    assert "under another name" in capsys.readouterr().err
