"""Ways in which a capture's file gets damaged, and what reading it then may do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hypothesis import strategies as st

HEAD = 1 << 13  # bytes of a binary file that are damaged; text is damaged anywhere
TEXT = (".txt", ".json", ".csv", ".xml", ".traj", ".log", ".pincam", ".yaml")
NO_NUMBERS = [b"nan", b"null", b"[]", b"{}", b"\x00", b"\xff\xfe", b"<", b'"', b"# "]
NUMBERS = [b"-1", b"0", b"1e999", b"9" * 400, b"-inf", b"7"]


def is_text(file: str) -> bool:
    return Path(file).suffix in TEXT or Path(file).name in ("metadata", "_info.txt")


def cut(data: bytes, at: float, word: bytes) -> bytes:
    return data[: int(at * len(data))]


def put_in(data: bytes, at: float, word: bytes) -> bytes:
    place = int(at * len(data))
    return data[:place] + word + data[place:]


def written_over(data: bytes, at: float, word: bytes) -> bytes:
    place = int(at * len(data))
    return data[:place] + word + data[place + len(word) :]


def zeroed(data: bytes, at: float, word: bytes) -> bytes:
    place = int(at * len(data))
    return data[:place] + bytes(min(64, len(data) - place)) + data[place + 64 :]


def all_bits(data: bytes, at: float, word: bytes) -> bytes:
    place = int(at * len(data))
    return data[:place] + b"\xff" * min(8, len(data) - place) + data[place + 8 :]


def line_gone(data: bytes, at: float, word: bytes) -> bytes:
    lines = data.splitlines(keepends=True)
    del lines[min(int(at * len(lines)), len(lines) - 1)]
    return b"".join(lines)


def line_twice(data: bytes, at: float, word: bytes) -> bytes:
    lines = data.splitlines(keepends=True)
    place = min(int(at * len(lines)), len(lines) - 1)
    ending = b"" if lines[place].endswith(b"\n") else b"\n"
    return b"".join(lines[: place + 1]) + ending + b"".join(lines[place:])


def lines_swapped(data: bytes, at: float, word: bytes) -> bytes:
    lines = data.splitlines()
    place = min(int(at * len(lines)), max(len(lines) - 2, 0))
    lines[place : place + 2] = lines[place : place + 2][::-1]
    return b"\n".join(lines) + b"\n"


def windows(data: bytes, at: float, word: bytes) -> bytes:
    return data.replace(b"\r\n", b"\n").replace(b"\n", b"\r\n")


def with_mark(data: bytes, at: float, word: bytes) -> bytes:
    return b"\xef\xbb\xbf" + data


def tabbed(data: bytes, at: float, word: bytes) -> bytes:
    return data.replace(b" ", b"\t")


Mutation = Callable[[bytes, float, bytes], bytes]
# What follows changes no number into another one: whatever is still read must be right.
STRUCTURE: tuple[Mutation, ...] = (
    put_in, written_over, zeroed, line_gone, line_twice, windows, with_mark, tabbed,
)  # fmt: skip
# And these may make other numbers that are as good: it must be read or refused, and what is read is finite.
ANY: tuple[Mutation, ...] = (cut, put_in, written_over, zeroed, all_bits, lines_swapped)


def cases(files: list[str]) -> st.SearchStrategy[tuple[str, Mutation, float, bytes, bool]]:
    """(file, mutation, where, word, whether what is read must be right)."""
    text = [file for file in files if is_text(file)]
    anything = st.tuples(
        st.sampled_from(files),
        st.sampled_from(ANY),
        st.floats(0, 1),
        st.sampled_from(NO_NUMBERS + NUMBERS),
        st.just(False),
    )
    if not text:
        return anything
    structure = st.tuples(
        st.sampled_from(text), st.sampled_from(STRUCTURE), st.floats(0, 1), st.sampled_from(NO_NUMBERS), st.just(True)
    )
    return st.one_of(structure, anything)


def mutated(data: bytes, file: str, mutation: Mutation, at: float, word: bytes) -> bytes:
    """A file's bytes with one damage; of a binary file its beginning is damaged."""
    if is_text(file) or len(data) <= HEAD or mutation is cut:
        return mutation(data, at, word) if data else word
    return mutation(data[:HEAD], at, word) + data[HEAD:]
