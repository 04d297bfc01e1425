"""Which pose, depth map or mask is a photo's: by name, by number, and by place only where nothing can be missing.

People delete photos and keep the list of poses; what is then paired by place is wrong from the first gap on.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

from room2dgs.captures.listing import natural
from room2dgs.errors import InputError

DIGITS = re.compile(r"[0-9]+")
LONGEST_NUMBER = 18  # digits


def numbers_of(names: Sequence[str], beside: Sequence[str] = ()) -> tuple[dict[str, int], dict[str, int]]:
    """The numbers in files' names by which they differ, as "frame000004.jpg" has 4; suffixes do not count.

    Of several runs of digits ("0000001-000000033369.jpg") it is the one with the smallest numbers: those count files.

    Args:
        beside: other files that are numbered alike, their names made in another way or not.

    Returns:
        name -> number, for each of both; empty where the names do not tell.
    """
    runs, others = _runs(names), _runs(beside)
    if runs and others and len(runs[0]) == len(others[0]):
        column = _column(runs, others)
        return _column_of(names, runs, column), _column_of(beside, others, column)
    return _column_of(names, runs, _column(runs)), _column_of(beside, others, _column(others))


def _runs(names: Sequence[str]) -> list[list[str]]:
    """Runs of digits in each name; none if the names are not made alike."""
    runs = [DIGITS.findall(Path(name).stem) for name in names]
    alike = len({len(found) for found in runs}) == 1
    return runs if alike and all(len(run) <= LONGEST_NUMBER for found in runs for run in found) else []


def _column(runs: list[list[str]], others: list[list[str]] | None = None) -> int | None:
    """Which run numbers the files: it differs between all of them."""
    found = []
    for column in range(len(runs[0]) if runs else 0):
        both = [[int(run[column]) for run in each] for each in (runs, others or [])]
        if all(len(set(values)) == len(values) for values in both):
            found.append((max(both[0] + both[1]), -column))
    return -min(found)[1] if found else None


def _column_of(names: Sequence[str], runs: list[list[str]], column: int | None) -> dict[str, int]:
    if column is None:
        return {}
    return {name: int(run[column]) for name, run in zip(names, runs, strict=True)}


def alike(photos: Sequence[str], others: Sequence[str]) -> dict[str, str]:
    """Which of other files belongs to each photo: the one of its name but for the suffix, else of its number; where
    names have no numbers and there are as many of both, the one at its place in natural order.

    Returns:
        photo -> other; photos without one are left out.
    """
    by_stem = {Path(name).stem: name for name in natural(others)}
    found = {name: by_stem[Path(name).stem] for name in photos if Path(name).stem in by_stem}
    if len(found) == len(photos) or not others:
        return found
    numbers, other_numbers = numbers_of(photos, others)
    if numbers and other_numbers:
        by_number = {number: name for name, number in other_numbers.items()}
        return found | {name: by_number[n] for name, n in numbers.items() if n in by_number and name not in found}
    if not found and len(photos) == len(others):
        return dict(zip(natural(photos), natural(others), strict=True))
    return found


def places(
    photos: Sequence[str],
    count: int,
    label: object,
    beside: Iterable[str] = (),
    from_zero: bool = True,
    keyed: bool = False,
    damage: InputError | None = None,
) -> dict[str, int]:
    """Which of a list of poses is each photo's.

    It is the one of the photo's number, if the list is long enough for all numbers; then photos may be missing. Else
    it is the one at the photo's place, if as many photos as poses are known and their numbers do not look as if some
    were missing.

    Args:
        photos: names of the files.
        count: how many poses the list has.
        label: the list's file, for messages.
        beside: names of depth maps, numbered as the photos: they tell of photos that are missing.
        from_zero: the layout numbers its photos from 0; False: some begin at 1.
        keyed: the list says its poses' numbers itself, so there may be photos behind its last one.
        damage: of a line of the list, which may be one too many; then as many photos as poses must be known.

    Returns:
        name -> place in the list, from 0; beyond its end where it is keyed.

    Raises:
        InputError: neither tells; both counts are named. Or there is damage, and it may have moved other poses.
    """
    numbers, other_numbers = numbers_of(photos, list(beside))
    known = sorted({*numbers.values(), *other_numbers.values()})
    if damage is not None and count != len(known or photos):
        raise damage
    if numbers and known[-1] < count and (from_zero or known[0] == 0):
        return numbers
    if numbers and keyed and known == list(range(len(known))):
        return numbers
    if numbers and len(known) == count and _counts_alone(known, from_zero):
        place = {number: index for index, number in enumerate(known)}
        return {name: place[number] for name, number in numbers.items()}
    in_order = natural(photos)
    # a copy among numbered photos ("frame000004 (1).jpg") has no place of its own; and programs sort by letters too
    if not numbers and len(photos) == count and in_order == sorted(photos) and (_runs(photos) or not from_zero):
        return {name: index for index, name in enumerate(in_order)}
    told = f", numbered {known[0]} to {known[-1]}" if numbers else ""
    raise InputError(
        f"{label} has {count} poses for {len(photos)} photos{told}, and which is whose cannot be told; "
        "give as many of both, or number the photos by the poses' places, the first being 0"
    )


def _counts_alone(known: list[int], from_zero: bool) -> bool:
    """Whether photos' numbers, of which there are as many as poses, are no poses' places: all are larger than those, or
    they go in even steps, as those of a video's every tenth frame do. Else both may have lost some, and not the same.
    """
    steps = {after - before for before, after in pairwise(known)}
    if known[0] >= len(known):
        return True
    return len(steps) == 1 and (not from_zero or (known[0] == 0 and steps != {1}))


def note_on(used: int, count: int, label: object) -> list[str]:
    """What a person is told where a list has more poses than photos."""
    return [] if used == count else [f"poses: {used} of the {count} in {label} have a photo, by its number"]
