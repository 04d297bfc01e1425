"""Protocols `neuris` and `manhattan` on dense meshes whose answer is known."""

import numpy as np
import pytest
import trimesh

from room2dgs.eval.protocol_manhattan import manhattan
from room2dgs.eval.protocol_neuris import neuris

SMALL = (1.2, 1.0, 0.8)
SPACING = 0.01
CELLS = 0.012  # of the area: what cells of 2 cm may misplace at edges


@pytest.fixture
def score(make):
    def run(protocol, pred, gt):
        result = protocol(make.file(pred), make.file(gt), make.all_around(), make.options())
        return result.scores.as_dict()

    return run


@pytest.fixture
def small_room(make):
    return make.room(SMALL, SPACING)


@pytest.mark.parametrize("protocol", [neuris, manhattan])
def test_a_room_against_itself(score, small_room, protocol):
    values = score(protocol, small_room, small_room)
    assert values["f_score_2cm"] == 1
    assert values["accuracy_m"] < (1e-9 if protocol is neuris else 0.01)
    assert values["normal_consistency"] is None


@pytest.mark.parametrize("protocol", [neuris, manhattan])
def test_a_sphere_too_large(score, protocol):
    truth = trimesh.creation.icosphere(subdivisions=6, radius=0.7)
    values = score(protocol, trimesh.creation.icosphere(subdivisions=6, radius=0.73), truth)
    # averaged vertices lie up to 1 mm inside the sphere, and up to a cell apart along it
    for key in ("accuracy_m", "completion_m"):
        assert 0.029 < values[key] < np.hypot(0.03, 0.012), key
    assert values["f_score_2cm"] == 0
    assert values["f_score_5cm"] == 1


@pytest.mark.parametrize("protocol", [neuris, manhattan])
def test_a_missing_wall_costs_recall_its_share(make, score, small_room, protocol):
    w, d, h = SMALL
    total = 2 * (w * d + d * h + h * w)
    values = score(protocol, make.room(SMALL, SPACING, without=["north"]), small_room)
    assert values["recall_5cm"] == pytest.approx(1 - (w - 0.1) * (h - 0.1) / total, abs=CELLS)
    assert values["precision_5cm"] == 1


@pytest.mark.parametrize("protocol", [neuris, manhattan])
def test_what_no_camera_sees_of_the_prediction_is_removed(make, score, small_room, protocol):
    shell = make.room([side + 0.1 for side in SMALL], 0.02)  # inside NeuRIS's box x 1.1, partly
    values = score(protocol, make.join(small_room, shell), small_room)
    assert values["precision_2cm"] == 1


def test_only_neuris_cuts_the_truth_to_what_is_seen(make, score, small_room):
    shell = make.moved(make.quad((0, 0, 0), (1, 0, 0), (0, 1, 0), 100), 0, 0, 2)
    truth = make.join(small_room, shell)
    w, d, h = SMALL
    total = 2 * (w * d + d * h + h * w)
    assert score(neuris, small_room, truth)["recall_5cm"] == 1
    assert score(manhattan, small_room, truth)["recall_5cm"] == pytest.approx(1 - 1 / (total + 1), abs=CELLS)


def test_neuris_drops_what_any_view_sees_beside_the_truth(make, score, small_room):
    open_room = make.room(SMALL, SPACING, without=["north"])
    # the filled opening is no error there; to `manhattan`, which masks nothing, it is one
    assert score(neuris, small_room, open_room)["precision_5cm"] == 1
    assert score(manhattan, small_room, open_room)["precision_5cm"] < 0.9


def test_neuris_cuts_the_prediction_at_the_box(make, score, small_room):
    # seen through the opening, outside the truth's box x 1.1 but in front of a true surface beyond it
    open_room = make.room(SMALL, SPACING, without=["north"])
    floater = make.quad((-0.3, 0.2, -0.2), (0.2, 0, 0), (0, 0, 0.2), 20)
    inside = score(neuris, make.join(open_room, floater), small_room)
    outside = score(neuris, make.join(open_room, make.moved(floater, 0, 0.45, 0)), small_room)
    assert inside["precision_5cm"] < 0.995
    assert outside["precision_5cm"] == 1


def test_a_prediction_of_few_large_faces_is_as_good(make, score, small_room):
    few = make.room(SMALL, 0.2)
    assert len(few.faces) < 0.01 * len(small_room.faces)
    values = score(neuris, few, small_room)
    assert values["recall_2cm"] > 0.98 and values["precision_2cm"] > 0.98


@pytest.mark.parametrize("protocol", [neuris, manhattan])
def test_an_unseen_prediction_scores_nothing(make, score, small_room, protocol):
    away = make.moved(make.quad((0, 0, 0), (1, 0, 0), (0, 1, 0), 10), 0, 0, 50)
    values = score(protocol, away, small_room)
    assert values["accuracy_m"] is None
    assert values["completion_m"] is None
    assert values["f_score_5cm"] == 0


@pytest.mark.parametrize("protocol", [neuris, manhattan])
def test_constants_tell_a_coarse_truth(make, protocol):
    coarse = make.file(make.room(SMALL))
    result = protocol(coarse, coarse, make.all_around()[:1], make.options())
    assert result.constants["gt_edge_m"] > 1
    assert result.constants["downsample_m"] == 0.02
