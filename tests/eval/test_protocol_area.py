"""Protocol `area` on geometry whose answer is known."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from room2dgs.eval.protocol import MeshFile, Options
from room2dgs.eval.protocol_area import area
from room2dgs.geometry.camera import Camera

SHARE = 2e-3  # of 40,000 stratified samples: what their edges may misplace


@pytest.fixture
def score(make):
    def run(pred, gt, cameras=None, **changes):
        cameras = make.all_around() if cameras is None else cameras
        return area(make.file(pred), make.file(gt), cameras, make.options(**changes)).scores.as_dict()

    return run


def total(size):
    return 2 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0])


def test_a_room_against_itself_is_perfect(make, score):
    values = score(make.room(), make.room())
    assert values["accuracy_m"] < 1e-6
    assert values["completion_m"] < 1e-6
    assert values["normal_consistency"] == pytest.approx(1, abs=1e-6)
    for name in ("1cm", "2cm", "5cm", "10cm"):
        assert values[f"f_score_{name}"] == 1


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-1e4, 1e4))
def test_any_mesh_against_itself_is_perfect_wherever_it_stands(seed, far):
    rng = np.random.default_rng(seed)
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=2)
    mesh.vertices += rng.normal(0, 0.1, mesh.vertices.shape)
    world = np.eye(4)
    world[:3, :3] = Rotation.random(random_state=seed % 2**31).as_matrix()
    world[:3, 3] = [far, -far, 3.0]
    K = np.array([[80.0, 0, 60], [0, 80.0, 50], [0, 0, 1]])
    camera = Camera(K, 120, 100, np.linalg.inv(world))
    mesh.apply_transform(world)
    options = Options(threshold_m=0.05, samples=2000, seed=seed)
    result = area(MeshFile(mesh), MeshFile(mesh), [camera], options)
    assert result.scores.accuracy_m < 1e-5
    assert result.scores.as_dict()["f_score_1cm"] == 1
    assert result.constants["gt_samples"] > 500


@pytest.mark.parametrize("shift", [-0.03, 0.03, 0.07])
def test_a_shifted_plane_is_off_by_the_shift(make, score, shift):
    plane = make.quad((-2, 2, -2), (4, 0, 0), (0, 0, 4))
    values = score(make.moved(plane, 0, shift, 0), plane, [make.camera_at((0, 0, 0), (0, 1, 0))])
    assert values["accuracy_m"] == pytest.approx(abs(shift), rel=1e-4)
    assert values["completion_m"] == pytest.approx(abs(shift), rel=1e-4)
    assert values["chamfer_m"] == pytest.approx(abs(shift), rel=1e-4)
    assert values["f_score_2cm"] == 0
    assert values["f_score_5cm"] == (1 if abs(shift) < 0.05 else 0)
    assert values["f_score_10cm"] == 1


def test_a_sphere_too_large_is_off_by_the_difference(make, score):
    inner = trimesh.creation.icosphere(subdivisions=5, radius=1.0)
    outer = trimesh.creation.icosphere(subdivisions=5, radius=1.03)
    values = score(outer, inner)
    assert values["accuracy_m"] == pytest.approx(0.03, abs=3e-4)  # facets stand 0.2 mm inside the sphere
    assert values["completion_m"] == pytest.approx(0.03, abs=3e-4)
    assert values["normal_consistency"] > 0.999
    assert (values["f_score_2cm"], values["f_score_5cm"]) == (0, 1)


def test_a_missing_wall_costs_recall_its_share(make, score):
    w, _, h = make.SIZE
    values = score(make.room(without=["north"]), make.room())
    # what lies within 5 cm of the neighbouring walls counts as found
    assert values["recall_5cm"] == pytest.approx(1 - (w - 0.1) * (h - 0.1) / total(make.SIZE), abs=SHARE)
    assert values["precision_5cm"] == 1


def test_a_wall_that_the_truth_lacks_is_not_judged(make, score):
    values = score(make.room(), make.room(without=["north"]))
    assert values["precision_5cm"] == 1
    assert values["recall_5cm"] == 1


@pytest.mark.parametrize("shift", [-0.1, 0.1])
def test_a_wall_10_cm_off_costs_both(make, score, shift):
    w, _, h = make.SIZE
    sides = make.walls()
    sides["north"] = make.moved(sides["north"], 0, shift, 0)
    values = score(make.join(*sides.values()), make.room())
    near_edges = (w - 0.1) * (h - 0.1) / total(make.SIZE)
    # moved outwards it is far from every true wall; moved inwards its rim lies at the side walls
    wrong = w * h / total(make.SIZE) if shift > 0 else near_edges
    assert values["precision_5cm"] == pytest.approx(1 - wrong, abs=SHARE)
    assert values["recall_5cm"] == pytest.approx(1 - near_edges, abs=SHARE)


def test_a_floater_costs_precision_its_share(make, score):
    patch = make.quad((-0.5, 0.7, -0.5), (1, 0, 0), (0, 0, 1))
    values = score(make.join(make.room(), patch), make.room())
    assert values["precision_5cm"] == pytest.approx(1 - 1 / (total(make.SIZE) + 1), abs=SHARE)
    assert values["recall_5cm"] == 1


def test_a_floater_behind_a_floater_is_judged_too(make, score):
    patch = make.quad((-0.5, 0.7, -0.5), (1, 0, 0), (0, 0, 1))
    pair = make.join(patch, make.moved(patch, 0, 0.2, 0))
    values = score(make.join(make.room(), pair), make.room())
    assert values["precision_5cm"] == pytest.approx(1 - 2 / (total(make.SIZE) + 2), abs=SHARE)


def test_junk_behind_the_walls_is_not_judged(make, score):
    shell = make.room([side + 1 for side in make.SIZE])
    values = score(make.join(make.room(), shell), make.room())
    assert values["precision_5cm"] == 1
    assert values["accuracy_m"] < 1e-6


def test_junk_at_a_window_is_not_judged(make, score):
    sides = make.walls()
    w, d, h = make.SIZE
    parts = [  # the north wall with an opening of 1 m x 1 m
        make.quad((-w / 2, d / 2, -h / 2), (w / 2 - 0.5, 0, 0), (0, 0, h)),
        make.quad((0.5, d / 2, -h / 2), (w / 2 - 0.5, 0, 0), (0, 0, h)),
        make.quad((-0.5, d / 2, -h / 2), (1, 0, 0), (0, 0, h / 2 - 0.5)),
        make.quad((-0.5, d / 2, 0.5), (1, 0, 0), (0, 0, h / 2 - 0.5)),
    ]
    sides["north"] = make.join(*parts)
    truth = make.join(*sides.values())
    behind = make.quad((-0.55, d / 2 + 0.3, -0.55), (1.1, 0, 0), (0, 0, 1.1))
    values = score(make.join(truth, behind), truth)
    assert values["precision_5cm"] == 1
    # from a second place the same junk would stand in front of a true surface: there it is judged
    inside = make.moved(behind, 0, -0.8, 0)
    both = make.all_around() + make.all_around((1.2, 0.9, 0.3))
    assert score(make.join(truth, inside), truth, both)["precision_5cm"] < 0.99


def test_what_no_camera_looks_at_does_not_count(make, score):
    cameras = [make.camera_at((0, 0, 0), (0, 1, 0))]
    half = make.room(without=["south"])  # behind the camera's back
    assert score(half, make.room(), cameras)["f_score_5cm"] == 1
    assert (
        score(make.join(make.room(), make.quad((-1, -1, -1), (2, 0, 0), (0, 0, 2))), half, cameras)["precision_5cm"]
        == 1
    )


def test_cutting_triangles_up_changes_nothing(make, score):
    sides = make.walls()
    sides["north"] = make.moved(sides["north"], 0, 0.1, 0)
    sides["floor"] = make.moved(sides["floor"], 0, 0, 0.03)
    whole = make.join(*sides.values())
    fine = make.join(sides["north"].subdivide().subdivide().subdivide(), *(
        side for name, side in sides.items() if name != "north"
    ))  # fmt: skip
    a, b = score(whole, make.room()), score(fine, make.room().subdivide().subdivide())
    for key, value in a.items():
        assert b[key] == pytest.approx(value, abs=SHARE), key


def test_a_prediction_that_nobody_sees_scores_nothing(make, score):
    behind = make.quad((-1, -50, -1), (2, 0, 0), (0, 0, 2))
    values = score(behind, make.room(), [make.camera_at((0, 0, 0), (0, 1, 0))])
    assert values["accuracy_m"] is None
    assert values["chamfer_m"] is None
    assert values["f_score_5cm"] == 0
    assert values["completion_m"] > 40


def test_what_shows_through_a_missing_wall_is_judged(make, score):
    """The truth knows that the ray ends at the wall: unlike junk behind an intact wall this is an error."""
    w, d, h = make.SIZE
    far = make.quad((-0.5, d / 2 + 1, -0.5), (1, 0, 0), (0, 0, 1))
    values = score(make.join(make.room(without=["north"]), far), make.room())
    assert values["precision_5cm"] == pytest.approx(1 - 1 / (total(make.SIZE) - w * h + 1), abs=SHARE)


def test_the_threshold_is_in_the_key_and_the_seed_fixes_the_result(make, score):
    sides = make.walls()
    sides["north"] = make.moved(sides["north"], 0, 0.07, 0)
    pred = make.join(*sides.values())
    first, again = (score(pred, make.room(), threshold_m=0.075) for _ in range(2))
    assert first == again
    assert first["precision_7.5cm"] == 1
    assert first["precision_5cm"] < 0.9
    assert score(pred, make.room(), threshold_m=0.075, seed=1) != first


def test_constants_say_what_was_done(make):
    cameras = make.all_around()
    result = area(make.file(make.room(), sha256="a"), make.file(make.room(), sha256="b"), cameras, make.options())
    constants = result.as_dict()["constants"]
    assert constants["views"] == 6
    assert (constants["pred_sha256"], constants["gt_sha256"]) == ("a", "b")
    assert constants["gt_samples"] == pytest.approx(40_000, rel=0.01)
