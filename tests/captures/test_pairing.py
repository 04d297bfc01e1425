"""Photos are paired with poses and depth maps by name or number; by place only where nothing can be missing."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from room2dgs.captures.pairing import alike, from_both, numbers_of, places
from room2dgs.errors import InputError

SCHEMES = [
    "frame{:06d}.jpg",
    "img{}.png",
    "{}.jpg",
    "{:06d}_rgb.png",
    "scene0000_00_{:04d}.jpg",
    "cam2-{}.v1.png",
]
SUBSETS = st.sets(st.integers(0, 19), min_size=2)


@pytest.mark.parametrize("scheme", SCHEMES)
@given(left=SUBSETS)
def test_whatever_photos_are_gone_the_others_keep_their_poses(scheme, left):
    photos = [scheme.format(i) for i in left]
    assert places(photos, 20, "traj.txt") == {scheme.format(i): i for i in left}


@given(photos=SUBSETS, maps=SUBSETS, lines=st.integers(0, 40))
def test_a_list_of_poses_that_is_too_short_is_refused_or_whole(photos, maps, lines):
    """Numbers from 0: whatever is missing of photos, maps and poses' ends, no photo gets another's pose."""
    names, beside = [f"frame{i}.jpg" for i in photos], [f"depth{i}.png" for i in maps]
    known = sorted(photos | maps)
    even = known[0] == 0 and len(set(np.diff(known))) == 1
    try:
        found = places(names, lines, "traj.txt", beside)
    except InputError as error:
        assert f"{lines} poses for {len(photos)} photos" in str(error)
        assert known[-1] >= lines and (len(known) != lines or (known[0] < lines and not even))
        return
    if known[-1] < lines:
        assert found == {f"frame{i}.jpg": i for i in photos}
    else:
        assert (
            len(known) == lines
            and (known[0] >= lines or even)
            and found == {f"frame{i}.jpg": known.index(i) for i in photos}
        )


@pytest.mark.parametrize("first", [1, 8, 1000])
def test_photos_that_are_numbered_from_elsewhere_need_as_many_poses(first):
    names = [f"img{i}.png" for i in range(first, first + 6)]
    pair = partial(places, label="poses.txt", from_zero=first > 1)
    assert pair(names, 6) == {name: i for i, name in enumerate(names)}
    assert pair(names[::2], 6, beside=names) == {name: 2 * i for i, name in enumerate(names[::2])}
    with pytest.raises(InputError, match=r"poses\.txt has 6 poses for 3 photos, numbered"):
        pair([names[1], names[3], names[5]], 6)
    with pytest.raises(InputError, match=r"poses\.txt has 5 poses for 6 photos"):
        pair(names, 5)


def test_as_many_poses_as_photos_may_still_not_be_theirs():
    """Photo 0 and another line of the list are gone; every tenth frame of a video is no such case."""
    for known in ([1, 2, 3, 4, 5], [0, 1, 2, 3, 5], [1, 3, 5]):
        with pytest.raises(InputError, match="which is whose cannot be told"):
            places([f"frame{i}.jpg" for i in known], len(known), "traj.txt")
    with pytest.raises(InputError, match="which is whose cannot be told"):
        places(["0.jpg", "2.jpg", "3.jpg", "5.jpg"], 4, "trajectory.log", from_zero=False, keyed=True)
    tenth = [f"frame{i:06d}.jpg" for i in range(0, 60, 10)]
    assert list(places(tenth, 6, "traj.txt").values()) == [0, 1, 2, 3, 4, 5]


def test_photos_without_0_in_a_layout_that_may_begin_at_1_are_not_guessed():
    names = [f"{i}.png" for i in range(1, 6)]
    assert places(names, 6, "cameras") == {name: i + 1 for i, name in enumerate(names)}
    with pytest.raises(InputError, match="6 poses for 5 photos"):
        places(names, 6, "cameras", from_zero=False)
    assert places(["0.png", *names], 6, "cameras", from_zero=False)["5.png"] == 5


def test_a_list_that_numbers_its_poses_itself_may_end_before_the_photos():
    names = [f"{i}.png" for i in range(6)]
    assert places(names, 4, "trajectory.log", keyed=True) == {name: i for i, name in enumerate(names)}
    assert places(names[::5], 4, "trajectory.log", names, keyed=True) == {"0.png": 0, "5.png": 5}
    with pytest.raises(InputError, match="4 poses for 3 photos"):
        places(names[::2], 4, "trajectory.log", keyed=True)


def test_names_without_numbers_need_as_many_poses():
    assert places(["b.jpg", "a.jpg"], 2, "poses") == {"a.jpg": 0, "b.jpg": 1}
    for names in (["a.jpg"], ["a.jpg", "b.jpg", "c.jpg"], ["a1.jpg", "b1.jpg", "c1.jpg"]):
        with pytest.raises(InputError, match=f"2 poses for {len(names)} photos"):
            places(names, 2, "poses")


def test_a_copy_among_numbered_photos_takes_no_pose():
    names = [*(f"frame{i}.jpg" for i in range(5)), "frame3 (1).jpg"]
    with pytest.raises(InputError, match="6 poses for 6 photos"):
        places(names, 6, "traj.txt")


@given(photos=SUBSETS, maps=SUBSETS)
def test_depth_by_number_whatever_is_gone(photos, maps):
    assume(not from_both(sorted(photos), sorted(maps)))
    found = alike([f"frame{i:06d}.jpg" for i in photos], [f"depth{i}.png" for i in maps])
    assert found == {f"frame{i:06d}.jpg": f"depth{i}.png" for i in photos & maps}


@given(photos=SUBSETS, maps=st.sets(st.integers(0, 19), min_size=1))
def test_one_map_is_not_numbered_by_what_all_names_share(photos, maps):
    assume(not from_both(sorted(photos), sorted(maps)))
    found = alike([f"scene0_2_{i}.jpg" for i in photos], [f"scene0_2_{i:05d}.png" for i in maps])
    assert found == {f"scene0_2_{i}.jpg": f"scene0_2_{i:05d}.png" for i in photos & maps}


@pytest.mark.parametrize("first", [0, 1])
def test_files_that_count_from_0_and_from_1_are_not_paired_by_number(first):
    photos = [f"frame{i + first}.jpg" for i in range(3)]
    with pytest.raises(
        InputError, match=f"photos frame{first}.jpg to frame{first + 2}.jpg and files {1 - first}.png to"
    ):
        alike(photos, [f"{i + 1 - first}.png" for i in range(3)])
    assert len(alike(photos, [f"{i + 1 - first}.png" for i in range(4)])) >= 2  # nor are they as many


def test_keyed_poses_that_count_from_1_are_not_those_of_photos_from_0():
    photos = [f"{i:06d}_rgb.png" for i in range(4)]
    with pytest.raises(InputError, match="has poses 1 to 4 for photos numbered 0 to 3"):
        places(photos, 5, "cameras.npz", keyed=True, keys=range(1, 5))
    assert places(photos, 5, "cameras.npz", keyed=True, keys=range(5)) == {name: i for i, name in enumerate(photos)}
    # a .log counts from 0, and its photos may count from 1
    assert places(["1.jpg", "2.jpg", "3.jpg"], 3, "t.log", from_zero=False, keyed=True, keys=range(3))["1.jpg"] == 0


def test_the_same_name_comes_before_the_number():
    assert alike(["5.jpg", "6.jpg"], ["005.png", "5.png", "6.png"]) == {"5.jpg": "5.png", "6.jpg": "6.png"}


def test_maps_whose_names_tell_nothing_need_as_many_photos():
    assert alike(["left.jpg", "right.jpg"], ["one.png", "two.png"]) == {"left.jpg": "one.png", "right.jpg": "two.png"}
    assert alike(["left.jpg", "right.jpg"], ["one.png"]) == {}
    assert alike(["1.jpg", "2.jpg"], ["7.png", "8.png"]) == {}


def test_numbers_that_count_files_and_not_their_times():
    names = [f"{i:07d}-{i * 33333:012d}.jpg" for i in range(1, 5)]
    assert list(numbers_of(names)[0].values()) == [1, 2, 3, 4]
    assert numbers_of(["a.jpg", "b1.jpg"]) == ({}, {})
    assert numbers_of(["1" * 5000 + ".jpg"]) == ({}, {})
