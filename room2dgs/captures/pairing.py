"""Pairs photos with poses, depth maps and masks: by name, by number, and by position only if nothing can be missing.

People delete photos and keep the list of poses; what is then paired by place is wrong from the first gap on.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from itertools import pairwise
from pathlib import Path

from room2dgs.captures.listing import natural
from room2dgs.errors import InputError
from room2dgs.texts import shown_name

DIGITS = re.compile(r"[0-9]+")
LONGEST_NUMBER = 18  # digits
LEAST_IN_ORDER = 3  # numbers that tell from which one files are counted


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

    Raises:
        InputError: one of the two counts from 0 and the other, of as many, from 1.
    """
    check_first_number(photos, others)
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


def check_first_number(photos: Sequence[str], others: Sequence[str]) -> None:
    """Refuse files of which as many are numbered from 0 as the photos from 1, or the other way: which is whose cannot
    be told.

    Raises:
        InputError: so it is.
    """
    numbers, other_numbers = (sorted(found.values()) for found in numbers_of(photos, others))
    if not numbers or len(numbers) != len(other_numbers) or not from_both(numbers, other_numbers):
        return
    ends = [natural(names)[place] for names in (photos, others) for place in (0, -1)]
    raise InputError(
        "photos {} to {} and files {} to {} are as many and do not count from one number, so that which is whose "
        "cannot be told; number both alike".format(*map(shown_name, ends))
    )


def from_both(numbers: Sequence[int], others: Sequence[int]) -> bool:
    """Whether one of two sorted lists of numbers is 0, 1, 2, ... and the other 1, 2, 3, ...; they are no shorter."""
    if len(numbers) < LEAST_IN_ORDER:
        return False
    first, other = (list(range(start, start + len(numbers))) for start in (0, 1))
    return [list(numbers), list(others)] in ([first, other], [other, first])


def places(
    photos: Sequence[str],
    count: int,
    label: object,
    beside: Iterable[str] = (),
    from_zero: bool = True,
    keyed: bool = False,
    keys: Collection[int] = (),
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
        keyed: the list says its poses' numbers itself, so there may be photos behind its last one; keys: these numbers.
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
    numbers_from = min(numbers.values(), default=0)
    meant = not from_zero and numbers_from == 1  # photos from 1, which stand for poses from 0
    if not meant and len(keys) == len(numbers) and from_both(sorted(numbers.values()), sorted(keys)):
        raise InputError(
            f"{label} has poses {min(keys)} to {max(keys)} for photos numbered {numbers_from} to "
            f"{max(numbers.values())}, so that which is whose cannot be told; number both alike"
        )
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
    message = f", numbered {known[0]} to {known[-1]}" if numbers else ""
    raise InputError(
        f"{label} has {count} poses for {len(photos)} photos{message}, and which is whose cannot be told; "
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
