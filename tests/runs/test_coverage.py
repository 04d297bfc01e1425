"""What to film again: holes and weak places of a mesh whose answer is known, blurred photos."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs.eval.boundary_kinds import COLORS, FREE, NOT_SEEN, NOT_TRUSTED
from room2dgs.eval.surface import Surface
from room2dgs.mesh.boundary_file import BoundaryEdges
from room2dgs.runs.page.boundary import boundary_picture, boundary_sentences
from room2dgs.runs.page.coverage import blurred_photos, coverage, spots
from room2dgs.runs.page.mesh_layer import page_mesh, with_off
from room2dgs.runs.trust import Trust

SIDE = 4.0


def plate(make, hole=None):
    """A square at z = 0 of 4 x 4 m that faces up; without the triangles within `hole` of its middle."""
    mesh = make.quad((-SIDE / 2, -SIDE / 2, 0), (SIDE, 0, 0), (0, SIDE, 0), cells=40)
    if hole:
        keep = np.abs(mesh.triangles_center[:, :2]).max(axis=1) > hole
        mesh = trimesh.Trimesh(mesh.vertices, mesh.faces[keep], process=False)
    return page_mesh(mesh, 10_000)


@dataclass
class Photo:
    name: str
    camera: object = None
    pixels: np.ndarray | None = None

    def color(self):
        return self.pixels


def photos(cameras):
    return [Photo(f"p{number}", camera) for number, camera in enumerate(cameras)]


def looking_down(make, x, half_angle=60.0):
    return make.camera_at((x, 0, 1.5), (0, 0, -1), half_angle_deg=half_angle)


def test_places_that_few_photos_see_are_named_with_the_photo_to_look_in(make):
    cameras = [looking_down(make, x) for x in (-1.4, -1.35, -1.3, 1.9)]
    frames = [Photo(f"p{i}", camera) for i, camera in enumerate(cameras)]
    room = plate(make)
    seen = coverage(room, frames, {})
    left, right = room.vertices[:, 0] < 1.0, room.vertices[:, 0] > 1.5
    assert (seen.photos[left] >= 3).all() and (seen.photos[right] == 1).all()
    (spot,) = [spot for spot in spots(room, seen, frames) if "fewer than 3" in spot.text]
    assert spot.at[0] > 1.2 and "p3" in spot.text and spot.photo == "p3"


def test_a_hole_is_found_and_the_rim_is_none(make):
    room = plate(make, hole=0.45)
    cameras = [looking_down(make, x) for x in (-0.1, 0, 0.1)]
    (hole,) = spots(room, coverage(room, photos(cameras), {}), [Photo("p", cameras[0])])
    assert np.allclose(hole.at, 0, atol=0.05)
    assert "A hole of 1.4 m" in hole.text  # a square of 1 m, from corner to corner


@pytest.mark.parametrize(
    ("kind", "words"),
    [(FREE, None), (NOT_SEEN, "film into it"), (NOT_TRUSTED, "photos show, but whose depth is not sure")],
)
def test_a_hole_is_to_be_filmed_unless_it_is_seen_to_be_free(make, kind, words):
    room = plate(make, hole=0.45)
    cameras = [looking_down(make, x) for x in (-0.1, 0, 0.1)]
    ends = np.array([[(x, y, 0.0), (x, y + 0.1, 0.0)] for x in (-0.5, 0.5) for y in (-0.4, 0.0, 0.4)])
    kinds = np.full(len(ends), kind, np.uint8)
    kinds[0] = (kind + 1) % 3  # the commonest counts
    found = spots(room, coverage(room, photos(cameras), {}), [Photo("p", cameras[0])], BoundaryEdges(ends, kinds))
    assert [words in spot.text for spot in found if "hole" in spot.text] == ([] if words is None else [True])


def test_the_boundary_is_told_in_metres():
    metres = {"free": 1.24, "not_seen": 2.0, "not_trusted": 0.5}
    (line,) = boundary_sentences({"boundary_m": metres}, "m")
    assert "1.2 m seen to be free, 2.0 m not seen, 0.5 m seen, not trusted" in line
    assert boundary_sentences({}, "m") == boundary_sentences({"boundary_m": None}, "m") == []


def test_the_boundary_is_drawn_in_its_colours(make):
    mesh = make.quad((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    camera = looking_down(make, 0)
    ends = np.array([[(-1.0, -1, 0), (-1, 1, 0)], [(1.0, -1, 0), (1, 1, 0)]])
    edges = BoundaryEdges(ends, np.array([FREE, NOT_TRUSTED], np.uint8))
    picture = boundary_picture(Surface(mesh), edges, camera)
    for line, kind in zip(ends, edges.kind, strict=True):
        row, column = np.nonzero((np.abs(picture - COLORS[kind] / 255) < 0.2).all(axis=2))
        pixel = np.stack([column, row], axis=1) + 0.5
        start, end = camera.project(line)[0]
        x, y = (end - start) / np.linalg.norm(end - start)
        off = (pixel - start) @ np.array([-y, x])
        assert len(pixel) > 20 and np.abs(off).max() < 3


def test_a_surface_seen_only_at_a_slant_is_named(make):
    room = plate(make)
    low = [make.camera_at((-6 - 0.01 * i, 0, 0.3), (1, 0, -0.05), half_angle_deg=40) for i in range(4)]
    said = [spot.text for spot in spots(room, coverage(room, photos(low), {}), [Photo("p", low[0])])]
    assert [words for words in said if "slant" in words]


def test_how_far_the_mesh_is_off_is_told_where_photos_have_depth(make):
    """The plate is 1.5 m below; photos say 1.45 m on their left half, and nothing on the right."""
    room = plate(make)
    frames = photos([looking_down(make, x, half_angle=40) for x in (-0.1, 0.0, 0.1)])
    depth = np.zeros((30, 40), np.float16)
    depth[:, :20] = 1.45
    whole = np.full((30, 40), 255, np.uint8)
    off = coverage(room, frames, {frame.name: Trust(whole, whole, depth) for frame in frames}).off_m
    right = frames[1].camera.cam_from_world[0, :3]  # of the pictures, in the world
    side = room.vertices @ right
    middle = np.abs(room.vertices).max(axis=1) < 0.8
    assert np.allclose(off[middle & (side < -0.2)], 0.05, atol=2e-3)
    assert np.isnan(off[middle & (side > 0.2)]).all()
    shown = with_off(room, off).off_m
    assert np.isfinite(shown).all() and shown.max() == pytest.approx(0.05, abs=2e-3)
    assert with_off(room, np.full(len(off), np.nan)).off_m is None


def test_a_blurred_photo_is_named():
    sharp = (np.random.default_rng(0).random((240, 320, 3)) * 255).astype(np.uint8)
    frames = [Photo(str(i), pixels=sharp) for i in range(9)]
    frames[4].pixels = cv2.GaussianBlur(sharp, (0, 0), 4)
    assert blurred_photos(frames) == ["4"]
