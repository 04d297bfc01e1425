"""What the tests of the documentation read: pages, their code, links and headings."""

from __future__ import annotations

import re
import textwrap
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
AT_THE_TOP = tuple(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"))
FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^\1```", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"`([^`]+)`")
LINK = re.compile(r"!?\[(?:[^\]\[]|\[[^\]]*\])*\]\(([^)\s]+)\)")


class Code(NamedTuple):
    """A piece of code on a page.

    Attributes:
        page: where it stands, for messages.
        language: of a fenced block; "" where none is named, "inline" for code in a sentence.
        text: without the fence.
    """

    page: str
    language: str
    text: str


def pages() -> tuple[Path, ...]:
    """All pages in Markdown."""
    return (*AT_THE_TOP, *sorted(DOCS.rglob("*.md")))


def name_of(page: Path) -> str:
    """Its path in the repository."""
    return page.relative_to(ROOT).as_posix()


def blocks(page: Path) -> Iterator[Code]:
    """Fenced blocks, also those inside of others' indentation."""
    for found in FENCE.finditer(page.read_text(encoding="utf-8")):
        yield Code(name_of(page), found[2], textwrap.dedent(found[3]))


def prose(page: Path) -> str:
    """The page without fenced blocks and comments."""
    return re.sub(r"<!--.*?-->", "", FENCE.sub("", page.read_text(encoding="utf-8")), flags=re.DOTALL)


def inline(page: Path) -> Iterator[Code]:
    """Code in sentences and tables."""
    for found in INLINE.finditer(re.sub(r"\s*\n\s*(?=[^|\n])", " ", prose(page))):
        yield Code(name_of(page), "inline", found[1])


def commands() -> Iterator[tuple[str, str]]:
    """(page, line) of each line that is typed into a shell, comments and continuations resolved."""
    for page in pages():
        for block in blocks(page):
            if block.language in ("", "bash", "shell"):
                for typed in block.text.replace("\\\n", " ").splitlines():
                    line = typed.split(" #")[0].strip()
                    if line and not line.startswith("#"):
                        yield block.page, line
        for code in inline(page):
            if re.match(r"(room2dgs|make|python -m room2dgs\S*|pip) [a-z\-']", code.text):
                yield code.page, code.text


def anchors(page: Path) -> set[str]:
    """What `#...` may name on a page, as Python-Markdown and GitHub make them of headings."""
    found = set()
    for heading in re.findall(r"^#+ +(.+?)\s*$", FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading.replace("`", "").replace("*", ""))
        plain = unicodedata.normalize("NFKD", plain).encode("ascii", "ignore").decode()
        found.add(re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", plain).strip().lower()))
    return found
