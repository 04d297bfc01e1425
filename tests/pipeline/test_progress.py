"""The whole run's progress: time left from the first second, corrected as the machine shows its pace."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.config import load_config
from room2dgs.pipeline.progress import STAGES, Progress, expected_seconds, listed_photos

WANTED = {"read": 1.0, "poses": 20.0, "train": 60.0, "mesh": 20.0}


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def progress(clock):
    made = Progress(clock)
    made.expect(WANTED)
    return made


def config(*more):
    return load_config(["scene.path=room", "out=run", *more])


def test_time_is_told_from_the_first_second(progress):
    assert progress.left_s() == pytest.approx(101.0)
    progress.begin("read")
    assert progress.left_s() == pytest.approx(101.0) and progress.share() == pytest.approx(0, abs=0.01)


def test_a_slow_machine_is_found_out(progress, clock):
    progress.begin("read")
    progress.begin("poses")
    clock.now += 80  # four times the 20 s
    progress.begin("train")
    pace = (80 + 10) / (21 + 10)
    assert progress.left_s() == pytest.approx(80 * pace)


def test_within_a_stage_its_own_pace_counts(progress, clock):
    for stage in ("read", "poses", "train"):
        progress.begin(stage)
    clock.now += 30
    progress.tell("iteration 500/2000: loss 0.1 (rgb 0.1), 9 surfels, 9.0 it/s, 0.1 min left")
    assert progress.left_s() == pytest.approx(90 + 20 * 10 / 31)
    progress.begin("mesh")
    progress.tell("textured mesh: 53 of 53 photos")  # never all done before the next one begins
    clock.now += 49
    assert progress.left_s() == pytest.approx(1.0)


def test_skipped_stages_are_not_waited_for(progress):
    progress.begin("mesh")
    assert progress.left_s() < 20.1


def test_other_lines_say_nothing(progress, clock):
    progress.begin("poses")
    clock.now += 5
    before = progress.left_s()
    for line in ("normal prior: 53 of 53 maps used", "sensor depth: 3 of 60 photos used", "7439 points"):
        progress.tell(line)
    assert progress.left_s() == before


@given(st.lists(st.tuples(st.sampled_from(list(STAGES)), st.floats(0, 1000)), max_size=20))
def test_it_never_goes_back_and_never_passes_the_end(steps):
    clock = Clock()
    progress = Progress(clock)
    progress.expect(WANTED)
    shares = []
    for stage, seconds in steps:
        progress.begin(stage)
        clock.now += seconds
        assert progress.left_s() >= 0
        shares.append(progress.share())
    assert shares == sorted(shares) and all(0 <= share <= 1 for share in shares)


def test_nothing_is_told_where_nothing_is_known(clock):
    assert Progress(clock).left_s() is None and Progress(clock).share() == 0


def test_stages_are_weighed_by_the_capture():
    small, large = (expected_seconds(config(), *size) for size in ((50, 0.08), (200, 0.5)))
    assert set(small) <= set(STAGES) and all(large[stage] >= small[stage] for stage in small)
    assert expected_seconds(config("experiment=quick"), 50, 0.08)["train"] < small["train"]
    draft = expected_seconds(config("preset=draft"), 50, 0.08)
    assert draft["train"] == draft["render"] == 0 < draft["mesh"]
    assert expected_seconds(config("export.textured=false"), 50, 0.08)["texture"] == 0


def test_photos_are_counted_before_the_capture_is_read(tmp_path):
    for folder, count in (("color", 5), ("depth", 3)):
        (tmp_path / folder).mkdir()
        for number in range(count):
            (tmp_path / folder / f"{number}.png").write_bytes(b"")
    assert listed_photos(config(f"scene.path={tmp_path}")) == 5
    assert listed_photos(config(f"scene.path={tmp_path}", "scene.frames=4")) == 4
    assert listed_photos(config(f"scene.path={tmp_path / 'gone'}")) > 5
