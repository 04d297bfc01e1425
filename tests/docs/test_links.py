"""Links, pictures and tables that pages name are there, and every page is in the site's navigation."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from tests.docs.pages import DOCS, LINK, ROOT, anchors, inline, name_of, pages, prose

TABLES = ROOT / "tools/study_tables"
SOURCES = ("room2dgs", "conf", "eval", "tools", "tests", ".ci")


@pytest.mark.parametrize("page", pages(), ids=name_of)
def test_every_link_leads_somewhere(page):
    for target in LINK.findall(prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = target.partition("#")
        place = (page.parent / file).resolve() if file else page
        assert place.exists(), f"{target} is not there"
        if anchor:
            assert anchor in anchors(place), f"{target}: the page has no such heading"


def _leaves(tree):
    if isinstance(tree, str):
        return [tree]
    return [leaf for one in (tree if isinstance(tree, list) else tree.values()) for leaf in _leaves(one)]


def _settings_of_the_site():
    class Loader(yaml.SafeLoader):
        """Reads tags of Python objects as their names."""

    Loader.add_multi_constructor("tag:yaml.org,2002:python/name:", lambda loader, suffix, node: suffix)
    return yaml.load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"), Loader)


def test_the_navigation_has_every_page_once():
    named = _leaves(_settings_of_the_site()["nav"])
    assert sorted(named) == sorted(page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md"))


def test_the_site_asks_no_other_host():
    site = _settings_of_the_site()
    assert site["theme"]["font"] is False and site["use_directory_urls"] is False
    assert "offline" in site["plugins"] and "extra_javascript" not in site
    styles = [(DOCS / style).read_text(encoding="utf-8") for style in site["extra_css"]]
    assert not any("//" in style or "@import" in style for style in styles)


def test_pictures_are_used():
    text = "".join(page.read_text(encoding="utf-8") for page in pages())
    unused = [picture.name for picture in (DOCS / "images").iterdir() if f"images/{picture.name}" not in text]
    assert not unused


def test_studies_name_every_raw_table():
    text = "".join(page.read_text(encoding="utf-8") for page in (DOCS / "studies").glob("*.md"))
    assert set(re.findall(r"\w+\.csv", text)) == {path.name for path in TABLES.glob("*.csv")}


def test_pages_that_the_sources_name_are_there():
    gone = []
    for path in (file for folder in SOURCES for file in (ROOT / folder).rglob("*") if file.suffix in TEXTS):
        for named in re.findall(r"\bdocs/[\w/-]+\.md\b", path.read_text(encoding="utf-8", errors="replace")):
            if not (ROOT / named).exists() and named not in OTHERS:
                gone.append(f"{path.relative_to(ROOT)}: {named}")
    assert not gone


def test_places_in_the_sources_that_pages_name_are_there():
    top = [path.name for path in (ROOT / "room2dgs").iterdir() if path.is_dir()]
    named = set()
    for page in pages():
        for code in inline(page):
            if re.fullmatch(r"[a-z_0-9]+(/[\w]+)+(\.py|\.h|/)?", code.text) and code.text.partition("/")[0] in (
                *top,
                *SOURCES,
            ):
                named.add(code.text)
    gone = [name for name in named if not ((ROOT / name).exists() or (ROOT / "room2dgs" / name).exists())]
    assert len(named) > 40
    assert [name for name in gone if "NAME" not in name and name not in OF_RUNS] == []


OF_RUNS = {"runs/room/", "runs/room/export"}
TEXTS = {".py", ".yaml", ".toml", ".md", ".txt", ".cpp", ".h", ".cu", ".sh"}
OTHERS = {"docs/onnx.md"}  # a page of MoGe's repository


def test_a_broken_link_would_be_seen(tmp_path):
    page = Path(tmp_path / "page.md")
    page.write_text("# One title\n[here](#one-title), [there](other.md#nowhere)\n", encoding="utf-8")
    assert LINK.findall(prose(page)) == ["#one-title", "other.md#nowhere"] and anchors(page) == {"one-title"}
