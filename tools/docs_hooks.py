"""Hooks of MkDocs that make the site one that needs no network.

Equations become MathML when the site is built, so that no script draws them. The script that searches in pages opened
from the disk is the site's own copy; the theme would load it from elsewhere.
"""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert
from mkdocs.utils import get_relative_url

EQUATION = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
ELSEWHERE, OURS = "https://unpkg.com/iframe-worker/shim", "javascripts/iframe-worker.js"


def on_page_content(content: str, **_: Any) -> str:
    """The page's HTML with each equation of pymdownx.arithmatex as MathML."""
    return EQUATION.sub(_mathml, content)


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """The whole page with the site's own script."""
    return output.replace(ELSEWHERE, get_relative_url(OURS, page.url))


def on_post_template(output_content: str, **_: Any) -> str:
    """Pages that are no page of ours, such as 404.html, which lie at the top."""
    return output_content.replace(ELSEWHERE, OURS)


def _mathml(found: re.Match[str]) -> str:
    display = "block" if found[2] == "[" else "inline"
    return f'<{found[1]} class="equation">{convert(html.unescape(found[3]).strip(), display=display)}</{found[1]}>'
