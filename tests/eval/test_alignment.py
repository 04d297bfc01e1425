"""A mesh in another frame is scored as in its own."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from room2dgs import cli
from room2dgs.errors import InputError
from room2dgs.eval.alignment import (
    by_cameras,
    by_surfaces,
    same_photos,
    transformed,
    transformed_camera,
    transformed_mesh,
)


def sim(scale: float, degrees: float, shift) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = scale * cv2.Rodrigues(np.radians(degrees) * np.array([0.48, 0.6, 0.64]))[0]
    matrix[:3, 3] = shift
    return matrix


def test_cameras_give_the_similarity_and_one_that_is_lost_does_not_pull():
    rng = np.random.default_rng(0)
    truth = {f"{i}": rng.uniform(-3, 3, 3) for i in range(20)}
    into = np.linalg.inv(sim(1.3, 130, [5, -2, 1]))
    pred = {f"frame_{int(i):06d}": transformed(centre[None], into)[0] for i, centre in truth.items()}
    pred["frame_000007"] += [2.0, 0, 1]
    found = by_cameras(pred, truth, with_scale=True)
    assert found.pairs == 20 and found.scale == pytest.approx(1.3, rel=1e-3)
    error = np.linalg.norm(
        transformed(np.array(list(pred.values())), found.truth_from_pred) - list(truth.values()), axis=1
    )
    assert np.delete(error, 7).max() < 0.01
    assert by_cameras(pred, truth, with_scale=False).scale == pytest.approx(1.0)
    with pytest.raises(InputError, match="has 0 of the run's photos"):
        by_cameras(pred, {f"photo{i}b{i + 500}": centre for i, centre in enumerate(truth.values())}, True)


def test_photos_are_the_same_by_name_or_by_a_number_that_only_one_has():
    assert same_photos(["a", "b", "c", "d"], ["d", "c", "b", "a"]) == [(name, name) for name in "abcd"]
    assert same_photos(["frame_000012", "frame_000013"], ["12", "13", "s2_13"]) == [("frame_000012", "12")]


@pytest.mark.parametrize("scale", [True, False])
def test_surfaces_are_brought_together_from_nearby(make, scale):
    truth = make.join(
        make.room(spacing=0.5), make.moved(make.quad([0, 0, 0], [0.8, 0.3, 0], [0, 0, 0.9]), 0.3, -0.5, -1.2)
    )
    off = sim(1.04 if scale else 1.0, 3, [0.08, -0.05, 0.06])
    pred = transformed_mesh(truth, np.linalg.inv(off))
    found = by_surfaces(pred, truth, None, with_scale=scale)
    assert not found.searched
    assert found.scale == pytest.approx(1.04 if scale else 1.0, abs=2e-3)
    left = np.linalg.norm(transformed(pred.vertices, found.truth_from_pred) - truth.vertices, axis=1)
    assert left.max() < 0.01
    stranger = make.moved(make.quad([0, 0, 0], [9.0, 0, 0], [0, 9.0, 0]), 50, 0, 0)
    with pytest.raises(InputError, match="align_scene"):
        by_surfaces(stranger, make.room((0.5, 0.5, 0.5)), None, with_scale=False)


@pytest.mark.parametrize(("degrees", "scale"), [(137, 1.0), (180, 1.12)])
def test_surfaces_far_turned_are_found(make, degrees, scale):
    """A room whose one box tells its four ways to stand apart, half a room away, and with a hole in the prediction."""
    box = make.moved(make.room((0.9, 0.5, 0.7), 0.25), 1.2, 0.8, -0.9)
    truth = make.join(make.room(spacing=0.25), box)
    part = make.join(make.room(spacing=0.25, without=("ceiling",)), box)
    pred = transformed_mesh(part, np.linalg.inv(sim(scale, degrees, [2.0, -1.5, 0.7])))
    found = by_surfaces(pred, truth, None, with_scale=scale != 1.0)
    assert found.searched and found.scale == pytest.approx(scale, abs=0.01)
    left = np.linalg.norm(transformed(pred.vertices, found.truth_from_pred) - part.vertices, axis=1)
    assert left.max() < 0.05
    assert "after a search" in found.line()


def test_a_moved_camera_sees_the_moved_point_at_the_same_pixel(camera):
    matrix = sim(0.7, 40, [1, 2, 3])
    point = camera.unproject(np.array([[12.0, 30.0]]), np.array([2.0]))
    pixel, depth = transformed_camera(camera, matrix).project(transformed(point, matrix))
    assert np.allclose(pixel, [[12.0, 30.0]]) and depth == pytest.approx(1.4)


@pytest.mark.slow
def test_eval_says_how_it_aligned(wall, tmp_path, capsys):
    """A wall whose mesh and cameras are in another frame and unit, scored by `room2dgs eval`."""
    import json
    import shutil

    import trimesh

    other = tmp_path / "other"
    shutil.copytree(wall, other)
    into = np.linalg.inv(sim(1.25, 25, [3.0, 1, -2]))
    for path in (other / "pose").iterdir():
        pose = np.loadtxt(path)
        pose[:3, :3] = into[:3, :3] * 1.25 @ pose[:3, :3]
        pose[:3, 3] = transformed(pose[None, :3, 3] + [0, 0.02 * int(path.stem) ** 2, 0], into)[0]
        np.savetxt(path, pose)
    bent = tmp_path / "bent"  # so that the cameras' centres tell a rotation: those of a straight row do not
    shutil.copytree(wall, bent)
    for path in (bent / "pose").iterdir():
        pose = np.loadtxt(path)
        pose[:3, 3] += [0, 0.02 * int(path.stem) ** 2, 0]
        np.savetxt(path, pose)
    (other / "gt_mesh.ply").unlink()
    transformed_mesh(trimesh.load(wall / "gt_mesh.ply", process=False), into).export(tmp_path / "pred.ply")
    given = [f"pred={tmp_path / 'pred.ply'}", f"gt={wall / 'gt_mesh.ply'}", f"scene={other}", "eval.samples=2000"]

    def score(*more: str) -> dict:
        out = tmp_path / f"out_{len(list(tmp_path.iterdir()))}"
        assert cli.main(["eval", *given, f"out={out}", *more]) == 0
        return json.loads((out / "metrics.json").read_text())

    apart, together = score(), score("eval.align=cameras", f"eval.align_scene={bent}")
    assert apart["align"] == "none" and not apart["f_score_5cm"]
    assert together["f_score_5cm"] > 0.99 and together["align"]["scale"] == pytest.approx(1.25, rel=1e-4)
    assert "aligned to the ground truth by cameras: scale 1.25" in capsys.readouterr().out
    assert cli.main(["eval", *given, f"out={tmp_path / 'o'}", "eval.align=cameras"]) == 2
    assert "eval.align_scene=DIR" in capsys.readouterr().err
