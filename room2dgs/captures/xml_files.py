"""XML files of captures, of bounded size, depth and number of elements; without entities, which can grow."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from room2dgs.captures.text_files import text_of
from room2dgs.errors import InputError

MAX_BYTES, CHUNK = 1 << 26, 1 << 16
MAX_ELEMENTS, MAX_DEPTH = 1_000_000, 64


def read_xml(path: Path, mend: str = "export it again") -> ElementTree.Element:
    """The root of a file's elements.

    Raises:
        InputError: no regular file, too large, no whole XML, with entities, or more or deeper elements than may be.
    """
    text = text_of(path, MAX_BYTES)
    if "<!ENTITY" in text or "<!DOCTYPE" in text:
        raise InputError(f"{path} declares a document type or entities, which an export has not; {mend}")
    parser = ElementTree.XMLParser(target=_Bounded(path, mend))
    try:
        for start in range(0, len(text), CHUNK):  # the parser stops for an error at the end of what it is fed
            parser.feed(text[start : start + CHUNK])
        return parser.close()
    except (ElementTree.ParseError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} is no whole XML ({error}); {mend}") from error


class _Bounded(ElementTree.TreeBuilder):
    def __init__(self, path: Path, mend: str) -> None:
        super().__init__()
        self._path, self._mend, self._depth, self._count = path, mend, 0, 0

    def start(self, tag: str, attributes: dict[str, str]) -> ElementTree.Element:
        self._depth += 1
        self._count += 1
        if self._depth > MAX_DEPTH:
            raise InputError(f"{self._path} has XML nested more than {MAX_DEPTH} deep; {self._mend}")
        if self._count > MAX_ELEMENTS:
            raise InputError(f"{self._path} has more than {MAX_ELEMENTS:,} XML elements; {self._mend}")
        return super().start(tag, attributes)

    def end(self, tag: str) -> ElementTree.Element:
        self._depth -= 1
        return super().end(tag)
