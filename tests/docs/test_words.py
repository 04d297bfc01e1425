"""Pages are short and in the field's words."""

from __future__ import annotations

import re

import pytest

from tests.docs.pages import DOCS, ROOT, name_of, pages

PRIVATE = re.compile(
    r"\bworth\b|\bsecond looks?\b|\bfirst looks\b|\blooks twice\b|\banchors?\b|\bagreeing\b|"
    r"side_by_side|few_faces|kept_depths|small_maps|room_lines|\bcarried\b|\bchains\b|second_look|a script\b",
    re.IGNORECASE,
)
SCENES = re.compile("8b5caf3398")  # of ScanNet++
ELSEWHERE = re.compile(r"Scaffold-GS: \w+")  # other programs' words, in the glossary


@pytest.mark.parametrize("page", pages(), ids=name_of)
def test_no_private_words(page):
    found = [one[0] for one in PRIVATE.finditer(ELSEWHERE.sub("", page.read_text(encoding="utf-8")))]
    assert not found


def test_the_glossary_has_the_words_of_the_settings():
    text = (DOCS / "how-it-works/glossary.md").read_text(encoding="utf-8")
    terms = re.findall(r"^\| ([^|]+) \|", text, re.MULTILINE)[2:]
    assert terms == sorted(terms, key=str.lower)
    for term in ("top_k", "num_source_views", "consistency", "pass", "track", "propagated", "depth samples", "low_res"):
        assert any(term in one for one in terms)


def test_the_readme_is_a_page():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 120
    assert "make demo" in lines and "make test" in lines  # as .ci/run types them


def test_the_first_version_is_told_in_sixty_lines():
    _, _, first = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").partition("## 0.1.0")
    assert 10 < len(first.splitlines()) <= 60


def test_studies_are_short():
    words = {page.name: len(page.read_text(encoding="utf-8").split()) for page in (DOCS / "studies").glob("*.md")}
    assert sum(words.values()) <= 4000 and max(words.values()) <= 600
    for page in (DOCS / "studies").glob("*.md"):
        text = page.read_text(encoding="utf-8")
        assert [
            text.count(f"**{part}**") + text.count(f"**{part}.**") for part in ("Question", "Decision", "Command")
        ] == [1, 1, 1]


def test_commits_stay_out_of_the_pages():
    for page in DOCS.rglob("*.md"):
        if page.name != "results.md":
            text = SCENES.sub("", page.read_text(encoding="utf-8"))
            assert not re.search(r"(?<![\w.])(?=[0-9a-f]*[a-f])(?=[0-9a-f]*\d)[0-9a-f]{7,40}(?![\w.])", text), page
