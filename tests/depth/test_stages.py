"""The list of stages: a source of one's own takes part in it, and a second pass is the same list again."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np
import pytest

from room2dgs.config import load_config
from room2dgs.depth import depth_of_frames, stages
from room2dgs.depth.align.one_view import RawMap
from room2dgs.depth.sources.source import DepthSource, Proposal
from room2dgs.errors import InputError
from room2dgs.registries.depth_sources import DEPTH_SOURCES
from room2dgs.registry import Entry
from room2dgs.stereo.depth_samples import DepthSamples


@pytest.fixture
def own_source(monkeypatch, room):
    """A source in a module of its own and one entry in the registry: the true depth, four fifths of it."""

    def depth(given):
        raw = {}
        for frame, exact in zip(room.frames, room.depths, strict=True):
            raw[frame.name] = RawMap((0.8 * exact).astype(np.float32), exact > 0)
        return Proposal(given.prior, raw=raw)

    module = ModuleType("my_depth_source")
    module.MINE = DepthSource(depth)
    monkeypatch.setitem(sys.modules, "my_depth_source", module)
    facts = {"normals": False, "network": False}
    entry = Entry("depth source", "mine", "my_depth_source:MINE", "Depth of my own.", facts)
    monkeypatch.setitem(DEPTH_SOURCES._own, "mine", entry)


def settings_of(*more: str):
    return load_config(["scene.path=a", "out=b", "prior=none", "prior.depth.source=mine", *more]).prior


def test_a_source_of_ones_own_is_a_module_and_an_entry(room, own_source):
    priors = depth_of_frames(room.frames, room.points, settings_of("prior.depth.joint=false"), lambda line: None)
    assert priors.depth_source == priors.label == "mine"
    for frame, exact in zip(room.frames, room.depths, strict=True):
        assert priors.fits[frame.name].scale == pytest.approx(1.25, rel=0.01)
        assert np.abs(priors.by_frame[frame.name].depth / exact - 1).max() < 0.02


def test_without_the_entry_the_name_is_unknown():
    with pytest.raises(InputError, match="mine"):
        settings_of()


def test_a_second_pass_is_the_same_list_again(room, own_source, monkeypatch):
    """Each stage runs once a pass; the second pass begins with the sparse points and the first pass's stereo."""
    runs = []

    def noted(stage):
        def run(state, settings):
            runs.append((state.pass_number, stage.__name__, len(state.samples)))
            return stage(state, settings)

        return run

    monkeypatch.setattr(stages, "STAGES", tuple(noted(stage) for stage in stages.STAGES))
    fewer = room.points.chosen(np.arange(len(room.points)) % 2 == 0)
    config = settings_of("prior.depth.correction=false")
    depth_of_frames(room.frames, room.points, config, lambda line: None, lambda first: DepthSamples(fewer, {}))
    names = [[name for number, name, _ in runs if number == which] for which in (0, 1)]
    assert names[0] == names[1] and names[0][:3] == ["propose", "compare", "align"]
    assert {number for number, _, _ in runs} == {0, 1}
    samples = {(number, name): count for number, name, count in runs}
    assert samples[0, "compare"] == samples[1, "compare"] == len(room.points)  # not those of the first pass
    assert samples[0, "align"] == samples[1, "align"] == len(fewer)
