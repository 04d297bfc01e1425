"""The breakdown names the surface that is wrong."""

import pytest

from room2dgs.eval.error_sites import sentences, where_the_error_sits
from room2dgs.eval.protocol_area import area
from room2dgs.eval.surface import Surface


@pytest.fixture
def sites(make):
    def run(pred, gt):
        # four level views as a person holds a phone: they give the up axis; the two others see floor and ceiling
        cameras = make.all_around()
        result = area(make.file(pred), make.file(gt), cameras, make.options(samples=8000))
        return where_the_error_sits(result, Surface(pred), Surface(gt), cameras)

    return run


@pytest.mark.parametrize("side, kind", [("floor", "floor"), ("ceiling", "ceiling"), ("west", "upright")])
def test_a_missing_side_is_named(make, sites, side, kind):
    part = sites(make.room(without=[side]), make.room())["recall"]
    assert part["by_surface"][kind]["wrong"] == 1
    assert sum(row["surface"] for row in part["by_surface"].values()) == pytest.approx(1)
    assert part["by_surface"]["other"]["surface"] == 0


def test_a_displaced_ceiling_is_wrong_by_its_distance(make, sites):
    sides = make.walls()
    sides["ceiling"] = make.moved(sides["ceiling"], 0, 0, -0.15)
    part = sites(make.join(*sides.values()), make.room())["precision"]
    assert part["by_surface"]["ceiling"]["wrong"] > 0.85  # its rim lies nearest to the walls
    assert part["by_distance"]["10-20 cm"]["wrong"] > 0.85
    assert part["by_distance"]["over 20 cm"]["wrong"] == 0


def test_a_table_top_is_no_floor(make, sites):
    table = make.quad((-0.5, -0.5, -0.5), (1, 0, 0), (0, 1, 0))
    part = sites(make.room(), make.join(make.room(), table))["recall"]
    assert part["by_surface"]["other"]["wrong"] == 1


def test_views_are_binned(make, sites):
    part = sites(make.room(without=["west"]), make.room())["recall"]
    assert sum(row["wrong"] for row in part["by_views"].values()) == pytest.approx(1)
    assert part["by_views"]["16+ views"]["surface"] == 0  # there are six cameras


def test_sentences_say_it(make, sites):
    lines = sentences(sites(make.room(without=["floor"]), make.room()))
    assert lines[0] == "mesh that is wrong: none"
    assert lines[1].startswith("surface that is missing: ")
    assert "floor 100%" in lines[1]
