"""Reads the elements of PLY files, text or binary; counts are checked against the file's size first."""

from __future__ import annotations

import re
import struct
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.errors import InputError
from room2dgs.regular_files import open_regular
from room2dgs.texts import shown_name

LONGEST_HEADER = 1 << 20
TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "int64": "i8", "uint64": "u8",
    "float16": "f2", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
FORMATS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
MOST_UNEQUAL = 20_000_000  # rows of lists of several lengths; they are looked at one by one
LARGEST_ROW = 1 << 30  # bytes of a row that is read as one of a table
OF_STRUCT = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f8": "d"}


class Property(NamedTuple):
    """Of an element.

    Attributes:
        name: "x".
        kind: of a value, as numpy has it, without the byte order.
        length: of a list's length; None: it is no list.
    """

    name: str
    kind: str
    length: str | None = None


@dataclass(frozen=True)
class Header:
    """What a file announces.

    Attributes:
        text: values are written out.
        order: of bytes, "<" or ">".
        elements: name -> how many, and their properties, in the file's order.
        body: where the values begin, bytes.
    """

    text: bool
    order: str
    elements: dict[str, tuple[int, list[Property]]]
    body: int


class Lists(NamedTuple):
    """A list in each row.

    Attributes:
        lengths: (N,) int64.
        values: (sum of lengths,), one row after another.
    """

    lengths: np.ndarray
    values: np.ndarray


class Element(NamedTuple):
    """Rows of a file.

    Attributes:
        single: name -> (N,) values.
        lists: name -> lists.
    """

    single: dict[str, np.ndarray]
    lists: dict[str, Lists]


def read_elements(path: Path, wanted: tuple[str, ...], mend: str = "write it again") -> dict[str, Element]:
    """The wanted elements that a PLY file has.

    Memory is the file's size times a small factor, whatever the header announces.

    Args:
        mend: what to do about a file that is missing, without a point at its end.

    Raises:
        InputError: missing, no regular file, no PLY, cut short, or longer than it says.
    """
    path = Path(path)
    with open_regular(path, mend) as file:
        head = file.read(LONGEST_HEADER)
        header = parsed_header(path, head)
        size = file.seek(0, 2) - header.body
        _check_counts(path, header, size)
        file.seek(header.body)
        body = file.read(size)
    return _Body(path, header, body).elements(wanted)


def parsed_header(path: Path, head: bytes) -> Header:
    """What a file begins with."""
    match = re.match(rb"ply[ \t]*(\r\n|\n|\r)", head)
    if not match:
        raise _refused(path, "it does not begin with 'ply'")
    newline = match[1]
    end = re.search(re.escape(newline) + rb"[ \t]*end_header[ \t]*" + re.escape(newline), head)
    if not end:
        raise _refused(path, "its header has no end")
    lines = head[match.end() : end.start() + len(newline)].decode("latin-1").split(newline.decode())
    form: str | None = None
    elements: dict[str, tuple[int, list[Property]]] = {}
    for line in filter(None, map(str.split, lines)):
        match line:
            case ["comment" | "obj_info", *_]:
                continue
            case ["format", name, _] if name in FORMATS and form is None:
                form = name
            case ["element", name, count] if re.fullmatch(r"\d{1,18}", count) and name not in elements:
                elements[name] = (int(count), [])
            case ["property", kind, name] if kind in TYPES and elements:
                _add(path, elements, Property(name, TYPES[kind]))
            case ["property", "list", count, kind, name] if count in TYPES and kind in TYPES and elements:
                if TYPES[count][0] == "f":
                    raise _refused(path, f"lengths of '{shown_name(name)}' are no whole numbers")
                _add(path, elements, Property(name, TYPES[kind], TYPES[count]))
            case _:
                raise _refused(path, f"its header has the line '{shown_name(' '.join(line))}'")
    if form is None:
        raise _refused(path, "its header names no format")
    return Header(form == "ascii", FORMATS[form], elements, end.end())


def _add(path: Path, elements: dict[str, tuple[int, list[Property]]], new: Property) -> None:
    properties = elements[next(reversed(elements))][1]
    if any(old.name == new.name for old in properties):
        raise _refused(path, f"its header has '{shown_name(new.name)}' twice in one element")
    properties.append(new)


def _check_counts(path: Path, header: Header, size: int) -> None:
    """Before anything is made for them: the rows that are announced need a file at least as large."""
    least = 0
    for count, properties in header.elements.values():
        # a number as text and the space after it; of a list its length alone
        bytes_each = (2 if header.text else np.dtype(one.length or one.kind).itemsize for one in properties)
        least += count * sum(bytes_each)
    if least > size + 1:
        announced = ", ".join(f"{count} {shown_name(name)}" for name, (count, _) in header.elements.items())
        raise _refused(path, f"it is cut short: it announces {announced}, which do not fit into its {size} bytes")


class _Body:
    """The values of a file; those of a text as doubles."""

    def __init__(self, path: Path, header: Header, body: bytes) -> None:
        self.path, self.header = path, header
        self.body = _numbers(path, body).tobytes() if header.text else body
        self.bytes = np.frombuffer(self.body, np.uint8)

    def elements(self, wanted: tuple[str, ...]) -> dict[str, Element]:
        found, at = {}, 0
        for name, (count, properties) in self.header.elements.items():
            if not properties:
                element = Element({}, {})
            elif any(one.length for one in properties):
                element, at = self._with_lists(name, count, properties, at, name in wanted)
            else:
                rows, at = self._rows(name, count, [(one.name, self._kind(one.kind)) for one in properties], at)
                element = Element({one.name: self._native(rows[one.name], one.kind) for one in properties}, {})
            if name in wanted:
                found[name] = element
        left = self.body[at:]
        if left and left not in (b"\n", b"\r\n"):
            what = f"{len(left) // 8} more numbers" if self.header.text else f"{len(left)} more bytes"
            raise _refused(self.path, f"it holds {what} than its header announces")
        return found

    def _kind(self, kind: str) -> str:
        """How a value is stored here."""
        return "<f8" if self.header.text else self.header.order + kind

    def _native(self, values: np.ndarray, kind: str) -> np.ndarray:
        """As the header has them, in this machine's byte order."""
        wanted = np.dtype(kind)
        if self.header.text and wanted.kind in "iu":
            limits = np.iinfo(wanted)
            # a NaN fails the comparison
            if len(values) and not (values.min() >= limits.min and values.max() <= limits.max):
                raise _refused(self.path, f"it holds numbers that do not fit into {wanted.name}")
        with np.errstate(over="ignore"):
            return values.astype(wanted, copy=False)

    def _rows(self, name: str, count: int, fields: list[tuple], at: int) -> tuple[np.ndarray, int]:
        kind = np.dtype(fields)
        end = at + count * kind.itemsize
        if end > len(self.body):
            raise self._short(name)
        return np.frombuffer(self.body, kind, count, at), end

    def _with_lists(
        self, name: str, count: int, properties: list[Property], at: int, wanted: bool
    ) -> tuple[Element, int]:
        if not count:
            empty = Lists(np.zeros(0, np.int64), np.zeros(0))
            single = {one.name: np.zeros(0, one.kind) for one in properties if not one.length}
            return Element(single, {one.name: empty for one in properties if one.length}), at
        equal = self._equal_lists(count, properties, at)
        if equal is not None:
            return equal
        starts, lengths, end = self._walked(name, count, properties, at)
        if not wanted:
            return Element({}, {}), end
        single, lists = {}, {}
        for index, one in enumerate(properties):
            kind = np.dtype(self._kind(one.kind))
            if one.length:
                values = self._gathered(starts[index], lengths[index], kind)
                lists[one.name] = Lists(lengths[index], self._native(values, one.kind))
            else:
                values = self._gathered(starts[index], np.ones(count, np.int64), kind)
                single[one.name] = self._native(values, one.kind)
        return Element(single, lists), end

    def _equal_lists(self, count: int, properties: list[Property], at: int) -> tuple[Element, int] | None:
        """If all rows have lists of the first one's lengths: a table."""
        fields, lengths, place = [], {}, at
        for one in properties:
            stored = self._kind(one.kind)
            if one.length:
                kind = np.dtype(self._kind(one.length))
                if place + kind.itemsize > len(self.body):
                    return None
                length = np.frombuffer(self.body, kind, 1, place)[0]
                if not 0 <= length <= len(self.body) or length != int(length):
                    return None
                lengths[one.name] = int(length)
                fields += [(f"length of {one.name}", kind), (f"list {one.name}", stored, (int(length),))]
                place += kind.itemsize + int(length) * np.dtype(stored).itemsize
            else:
                fields.append((f"single {one.name}", stored))
                place += np.dtype(stored).itemsize
        size = place - at
        if size * count > len(self.body) - at or size >= LARGEST_ROW:
            return None
        rows = np.frombuffer(self.body, np.dtype(fields), count, at)
        if any((rows[f"length of {name}"] != length).any() for name, length in lengths.items()):
            return None
        single = {one.name: self._native(rows[f"single {one.name}"], one.kind) for one in properties if not one.length}
        lists = {
            one.name: Lists(
                np.full(count, lengths[one.name], np.int64),
                self._native(rows[f"list {one.name}"].reshape(-1), one.kind),
            )
            for one in properties
            if one.length
        }
        return Element(single, lists), at + size * count

    def _walked(
        self, name: str, count: int, properties: list[Property], at: int
    ) -> tuple[list[np.ndarray], list[np.ndarray], int]:
        """Where the values of each property begin in each row, bytes, and how many they are; and where all end."""
        if count > MOST_UNEQUAL:
            raise _refused(self.path, f"it has {count} {shown_name(name)} of several sizes; write triangles alone")
        starts = [np.empty(count, np.int64) for _ in properties]
        lengths = [np.ones(count, np.int64) for _ in properties]
        steps = [
            (self._counted(one), np.dtype(self._kind(one.kind)).itemsize, start, length)
            for one, start, length in zip(properties, starts, lengths, strict=True)
        ]
        body, most = self.body, len(self.body)
        try:
            for row in range(count):
                for counted, size, start, length in steps:
                    if counted is None:
                        start[row] = at
                        at += size
                        continue
                    (many,) = counted.unpack_from(body, at)
                    at += counted.size
                    if not 0 <= many <= most:  # nor is it NaN
                        raise self._short(name)
                    start[row], length[row] = at, many
                    at += int(many) * size
        except struct.error as error:
            raise self._short(name) from error
        if at > most:
            raise self._short(name)
        return starts, lengths, at

    def _counted(self, one: Property) -> struct.Struct | None:
        """How a list's length is stored."""
        if one.length is None:
            return None
        return struct.Struct(self.header.order + ("d" if self.header.text else OF_STRUCT[one.length]))

    def _gathered(self, starts: np.ndarray, lengths: np.ndarray, kind: np.dtype) -> np.ndarray:
        """Values that lie at these places, one row after another."""
        first = np.cumsum(lengths) - lengths
        within = np.arange(int(lengths.sum())) - np.repeat(first, lengths)
        places = np.repeat(starts, lengths) + within * kind.itemsize
        gathered = np.stack([self.bytes[places + byte] for byte in range(kind.itemsize)], axis=1)
        return gathered.view(kind)[:, 0] if len(gathered) else np.zeros(0, kind)

    def _short(self, name: str) -> InputError:
        return _refused(self.path, f"it is cut short among its {shown_name(name)} elements")


def _numbers(path: Path, body: bytes) -> np.ndarray:
    """All numbers of a text, as doubles."""
    if b"(" in body:
        body = re.sub(rb"nan\(\w*\)", b"nan", body, flags=re.IGNORECASE)  # as one compiler's library writes it
    try:
        text = body.decode("ascii")
        if not text.strip():
            return np.zeros(0)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return np.fromstring(text, sep=" ")
    except (ValueError, DeprecationWarning) as error:
        raise _refused(path, "among its numbers is something that is none") from error


def _refused(path: Path, why: str) -> InputError:
    return InputError(f"{path} cannot be decoded as a PLY file: {why}; write it again")
