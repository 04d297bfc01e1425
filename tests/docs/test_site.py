"""The site builds without a warning, and nothing on it is loaded from elsewhere."""

from __future__ import annotations

import re

import pytest
from mkdocs.commands.build import build
from mkdocs.config import load_config

from room2dgs.tools.docs_hooks import on_page_content
from tests.docs.pages import DOCS, ROOT


@pytest.mark.slow
def test_the_site_builds_and_is_whole(tmp_path):
    build(load_config(str(ROOT / "mkdocs.yml"), site_dir=str(tmp_path / "site"), strict=True))
    made = list((tmp_path / "site").rglob("*.html"))
    assert len(made) == len(list(DOCS.rglob("*.md"))) + 1  # and 404.html
    for page in made:
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r'(?:src|href)="(?:https?:)?//[^"]+', re.sub(r"<a [^>]*>", "", text)), page
        assert "arithmatex" not in text and "unpkg" not in text, page
    method = (tmp_path / "site/how-it-works/method.html").read_text(encoding="utf-8")
    assert method.count("<math") > 40 and method.count('display="block"') > 8
    assert (tmp_path / "site/javascripts/iframe-worker.js").stat().st_size > 1000


def test_an_equation_becomes_mathml():
    made = on_page_content(r'<p>with <span class="arithmatex">\(a &lt; b_i\)</span> and</p>')
    assert made.startswith('<p>with <span class="equation"><math') and made.endswith("</span> and</p>")
    assert "<msub><mi>b</mi><mi>i</mi></msub>" in made and "&#x0003C;" in made
