"""Depth of a surface against measured depth, photo by photo."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from room2dgs.errors import InputError
from room2dgs.eval import evaluate
from room2dgs.eval.protocol_depth import DepthView, depth, depth_table, mesh_depth, view_figures

WALL_M = 2.0


def plane(make, x=WALL_M, cells=1) -> trimesh.Trimesh:
    """A wall that fills the image of a camera at the origin which looks along x."""
    return make.quad((x, -6.0, -6.0), (0.0, 12.0, 0.0), (0.0, 0.0, 12.0), cells)


def view(make, name="0", back_m=0.0, held_out=False, spoil=None) -> DepthView:
    """A photo of the wall at x = 2 m from `back_m` behind the origin; its depth is exact."""
    camera = make.camera_at((-back_m, 0.0, 0.0), (1.0, 0.0, 0.0))
    measured = np.full((camera.height, camera.width), WALL_M + back_m, np.float32)
    if spoil is not None:
        spoil(measured)
    return DepthView(name, camera, lambda: measured, held_out)


def score(make, mesh, *views):
    return depth(mesh_depth(make.file(mesh)), views)


def test_a_plane_at_a_known_distance(make):
    scores = score(make, plane(make, WALL_M + 0.04), view(make))
    figures = scores.by_view["0"]
    assert figures["coverage"] == figures["within_5cm"] == figures["within_10cm"] == figures["delta1"] == 1
    assert figures["within_2cm"] == 0
    assert figures["abs_rel"] == pytest.approx(0.02, abs=1e-6)
    assert figures["signed_rel_median"] == pytest.approx(0.02, abs=1e-6)
    nearer = score(make, plane(make, WALL_M - 0.04), view(make)).by_view["0"]
    assert nearer["signed_rel_median"] == pytest.approx(-0.02, abs=1e-6)
    assert nearer["abs_rel"] == pytest.approx(0.02, abs=1e-6)


def test_depth_is_along_the_axis_and_not_along_the_ray(make):
    """At the corner of the image the ray is 1.86 times as long as the depth."""
    assert score(make, plane(make), view(make)).by_view["0"]["within_2cm"] == 1


def test_pixels_without_mesh_are_wrong_and_lower_the_coverage(make):
    mesh = plane(make, cells=120)
    middles = mesh.triangles_center
    mesh.update_faces((middles[:, 1] > 0) | (middles[:, 2] > 0))  # a quarter of the image is a hole
    figures = score(make, mesh, view(make)).by_view["0"]
    assert figures["coverage"] == pytest.approx(0.75, abs=0.01)
    assert figures["within_5cm"] == figures["delta1"] == figures["coverage"]
    assert figures["abs_rel"] < 1e-5  # of the pixels that have both


def test_pixels_without_measured_depth_do_not_count(make):
    mesh = plane(make, cells=120)
    mesh.update_faces(mesh.triangles_center[:, 2] > 0)  # the upper half of the image

    def only_upper(measured):
        measured[len(measured) // 2 :] = 0

    def all_but_a_row(measured):
        measured[1:] = 0

    assert score(make, mesh, view(make, spoil=only_upper)).by_view["0"]["within_2cm"] == pytest.approx(1, abs=0.02)
    assert score(make, mesh, view(make)).by_view["0"]["within_2cm"] == pytest.approx(0.5, abs=0.02)
    few = score(make, mesh, view(make, spoil=all_but_a_row)).by_view["0"]
    assert few["pixels"] == view(make).camera.width
    nothing = score(make, mesh, view(make, spoil=lambda measured: measured.fill(0)))
    assert not nothing.by_view and not nothing.groups


def test_a_mesh_that_is_too_large_has_the_same_scale_error_in_each_photo(make):
    """Scaled about each camera, as a photo that is off by a scale sees it: 3 % at 2 m and at 4 m."""
    views = [view(make, "near"), view(make, "far", back_m=2.0, held_out=True)]
    for one in views:
        mesh = plane(make)
        mesh.vertices = one.camera.centre + 1.03 * (mesh.vertices - one.camera.centre)
        figures = score(make, mesh, one).by_view[one.name]
        for name in ("signed_rel_p5", "signed_rel_median", "signed_rel_p95", "abs_rel"):
            assert figures[name] == pytest.approx(0.03, abs=1e-5), name


def test_scale_errors_spread_over_the_photos_and_held_out_ones_are_apart(make):
    views = [view(make, str(index), back_m=0.5 * index, held_out=index == 4) for index in range(5)]
    scores = score(make, plane(make, WALL_M + 0.1), *views)
    errors = [0.1 / (WALL_M + 0.5 * index) for index in range(5)]
    training, held_out = scores.groups["training"], scores.groups["held_out"]
    assert (training["views"], held_out["views"], scores.groups["all"]["views"]) == (4, 1, 5)
    assert training["scale_error_median"] == pytest.approx(np.median(errors[:4]), abs=1e-5)
    assert training["scale_error_p5"] == pytest.approx(np.percentile(errors[:4], 5), abs=1e-5)
    assert training["scale_error_p95"] == pytest.approx(np.percentile(errors[:4], 95), abs=1e-5)
    assert held_out["scale_error_median"] == held_out["abs_rel"] == pytest.approx(errors[4], abs=1e-5)
    assert scores.as_dict()["by_view"]["4"]["held_out"] is True
    text = depth_table(scores.groups, "mesh")
    assert "training (4)" in text and "held-out (1)" in text and f"{errors[4]:+.1%}" in text


def test_each_photo_counts_the_same(make):
    """A photo whose sensor measured one row weighs as much as a full one."""

    def one_row(measured):
        measured[1:] = 0
        measured[0] += 1.0

    groups = score(make, plane(make), view(make, "0"), view(make, "1", spoil=one_row)).groups
    assert groups["all"]["within_5cm"] == pytest.approx(0.5)


def test_a_photo_that_sees_no_mesh_is_wrong_everywhere():
    figures = view_figures(np.zeros((2, 2), np.float32), np.ones((2, 2), np.float32))
    assert figures["coverage"] == figures["within_10cm"] == figures["delta1"] == 0
    assert figures["abs_rel"] is figures["signed_rel_median"] is None


def test_meshes_are_not_compared_by_it(make):
    with pytest.raises(InputError, match="protocol depth does not compare two meshes"):
        evaluate(plane(make), plane(make), [view(make).camera], ["area", "depth"])
